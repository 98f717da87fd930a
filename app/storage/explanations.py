"""Explanations: asked for, claimed for a time by a worker, then done or failed; given to another where it is lost."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import (
    ColumnElement,
    Connection,
    Select,
    Update,
    and_,
    exists,
    func,
    insert,
    literal,
    or_,
    select,
    true,
    update,
)

from app.counting import counted_times
from app.storage.asked_rows import SORTABLE
from app.storage.bulk import among_many, insert_new
from app.storage.leases import Reopened, take_back
from app.storage.loops import IN_SERVICE
from app.storage.tables import UNEXPLAINED, audit_items, explanations, loops, verdicts
from app.storage.types import clock_s, long_ago, longer_pause, now

NO_PAUSE: dict[str, None] = {"pause_s": None, "waits_since": None}
WITH_A_VERDICT = ("stiction", "no_stiction", "inconclusive")
REGULAR = 1.0


@dataclass(frozen=True)
class ExplanationRow:
    id: int
    loop_id: int
    audit_id: int | None
    state: str
    asked_at: datetime
    asked_by: str | None
    ended_at: datetime | None
    attempts: int
    window_start_ns: int | None
    window_end_ns: int | None
    as_judged: bool
    verdict: str | None
    effects: str
    error_code: str | None
    error_text: str | None
    waits_since: datetime | None

    @property
    def ended(self) -> bool:
        return self.state in ("done", "failed")


@dataclass(frozen=True)
class ExplanationClaim:
    """The right to end an explanation, until the lease ends; `attempt` fences off whoever had it before."""

    explanation_id: int
    attempt: int
    owner: str


COLUMNS = [explanations.c[name] for name in ExplanationRow.__dataclass_fields__]


def ask(connection: Connection, values: Mapping[str, Any]) -> int:
    return connection.execute(
        insert(explanations).values(**values, asked_at=now(), announced_s=clock_s()).returning(explanations.c.id)
    ).scalar_one()


def plan_for_run(connection: Connection, audit_id: int, count: int) -> int:
    """Asks for an explanation of the run's worst loops, once; returns how many were asked for.

    Worst: in the order in which lists have them, among those that stick or oscillate and of which no run asked for an
    explanation of the same input before.
    """
    if connection.scalar(select(exists().where(explanations.c.audit_id == audit_id))):
        return 0
    suspicious = or_(verdicts.c.verdict == "stiction", verdicts.c.oscillation_regularity > REGULAR)
    worst = (
        select(
            verdicts.c.loop_id,
            verdicts.c.audit_id,
            literal(now()).label("asked_at"),
            verdicts.c.input_start_ns,
            verdicts.c.input_end_ns,
            true().label("as_judged"),
        )
        .join(loops, loops.c.id == verdicts.c.loop_id)
        .where(verdicts.c.audit_id == audit_id, verdicts.c.verdict.in_(WITH_A_VERDICT), suspicious)
        .where(verdicts.c.stiction_probability.is_not(None), IN_SERVICE, ~_asked_before())
        .order_by(SORTABLE["priority"].desc().nulls_last(), loops.c.tag)
        .limit(count)
    )
    columns = ["loop_id", "audit_id", "asked_at", "window_start_ns", "window_end_ns", "as_judged"]
    asked = insert_new(connection, explanations).from_select(columns, worst).returning(explanations.c.id)
    return len(connection.scalars(asked).all())


def _asked_before() -> ColumnElement[bool]:
    """Whether an earlier run asked for an explanation of what this verdict was given."""
    earlier = verdicts.alias("earlier")
    same_loop = and_(earlier.c.loop_id == verdicts.c.loop_id, earlier.c.audit_id < verdicts.c.audit_id)
    given = ("input_start_ns", "input_end_ns", "input_fingerprint", "engine_version")
    same_input = (earlier.c[name] == verdicts.c[name] for name in given)
    asked = and_(explanations.c.loop_id == earlier.c.loop_id, explanations.c.audit_id == earlier.c.audit_id)
    joined = explanations.join(earlier, asked)
    return exists(select(explanations.c.id).select_from(joined).where(same_loop, *same_input).correlate(verdicts))


def by_id(connection: Connection, loop_id: int, explanation_id: int) -> ExplanationRow | None:
    query = select(*COLUMNS).where(explanations.c.id == explanation_id, explanations.c.loop_id == loop_id)
    row = connection.execute(query).one_or_none()
    return None if row is None else ExplanationRow(*row)


def page(connection: Connection, loop_id: int, limit: int, before_id: int | None = None) -> list[ExplanationRow]:
    """A loop's explanations, the newest first."""
    query = select(*COLUMNS).where(explanations.c.loop_id == loop_id).order_by(explanations.c.id.desc()).limit(limit)
    if before_id is not None:
        query = query.where(explanations.c.id < before_id)
    return [ExplanationRow(*row) for row in connection.execute(query)]


class Naming(NamedTuple):
    """An answer as it was stored, and until when what it is of was recorded."""

    packed: bytes
    window_end_ns: int | None


def newest_naming(
    connection: Connection, tags: Iterable[str], code: str, until: datetime | None = None
) -> dict[str, Naming]:
    """The answers of those loops whose newest explanation is done and has an effect of this code;
    by tag. until: the newest of those that had ended then (None: of all)."""
    wanted = (explanations.c.packed, explanations.c.window_end_ns)
    found = connection.execute(_naming(connection, tags, code, wanted, until))
    return {row.tag: Naming(row.packed, row.window_end_ns) for row in found}


def naming_ids(connection: Connection, tags: Iterable[str], code: str) -> dict[str, int]:
    """The ids of the same explanations."""
    return {row.tag: row.id for row in connection.execute(_naming(connection, tags, code, (explanations.c.id,)))}


def _naming(
    connection: Connection,
    tags: Iterable[str],
    code: str,
    wanted: Iterable[ColumnElement[Any]],
    until: datetime | None = None,
) -> Select[Any]:
    of_loops = select(loops.c.id).where(among_many(connection, loops.c.tag, tags))
    newest = select(func.max(explanations.c.id)).where(explanations.c.loop_id.in_(of_loops))
    newest = newest if until is None else newest.where(explanations.c.ended_at <= until)
    query = select(loops.c.tag, *wanted).join(loops, loops.c.id == explanations.c.loop_id)
    query = query.where(explanations.c.id.in_(newest.group_by(explanations.c.loop_id)))
    named = explanations.c.effects.contains(code, autoescape=True)
    return query.where(explanations.c.state == "done", named)


def count_open(connection: Connection, at_most: int) -> int:
    """Explanations that somebody asked for and that have not ended; counted no further than asked for."""
    waiting = select(explanations.c.id).where(UNEXPLAINED, explanations.c.audit_id.is_(None)).limit(at_most).subquery()
    return connection.scalar(select(func.count()).select_from(waiting)) or 0


def packed_answer(connection: Connection, explanation_id: int) -> bytes | None:
    """The answer as it was stored; before the end perhaps a first one."""
    return connection.scalar(select(explanations.c.packed).where(explanations.c.id == explanation_id))


def packed_simulation(connection: Connection, explanation_id: int) -> bytes | None:
    return connection.scalar(select(explanations.c.simulation_packed).where(explanations.c.id == explanation_id))


def claim_next(connection: Connection, owner: str, lease_s: float) -> ExplanationClaim | None:
    """The explanation that has waited longest, for `lease_s` seconds by the database's clock; None: nothing to do.

    What people asked for comes first. What a nightly run asked for waits until no loop waits to be audited. One that
    was tried before comes after those that were not: if it takes its worker down, others are done by then.
    """
    picked = (
        select(explanations.c.id)
        .where(*_waiting())
        .order_by(explanations.c.attempts, explanations.c.audit_id.is_not(None), explanations.c.id)
        .limit(1)
        .with_for_update(skip_locked=True)
        .cte("picked")
    )
    row = connection.execute(
        update(explanations)
        .where(explanations.c.id.in_(select(picked.c.id)), explanations.c.state == "open")
        .values(state="claimed", owner=owner, lease_until_s=clock_s() + lease_s, attempts=explanations.c.attempts + 1)
        .returning(explanations.c.id, explanations.c.attempts)
    ).one_or_none()
    return None if row is None else ExplanationClaim(row.id, row.attempts, owner)


def claimed(connection: Connection, claim: ExplanationClaim) -> ExplanationRow:
    query = select(*COLUMNS).where(explanations.c.id == claim.explanation_id)
    return ExplanationRow(*connection.execute(query).one())


def renew(connection: Connection, claim: ExplanationClaim, lease_s: float) -> bool:
    """Whether the claim still holds; its lease then starts anew."""
    return connection.execute(_held(claim).values(lease_until_s=clock_s() + lease_s)).rowcount == 1


def note_first(connection: Connection, claim: ExplanationClaim, packed: bytes) -> bool:
    """Keeps a first answer, where the claim still holds; the whole one takes its place."""
    return connection.execute(_held(claim).values(packed=packed)).rowcount == 1


def end(connection: Connection, claim: ExplanationClaim, state: str, values: Mapping[str, Any]) -> bool:
    """Whether the claim still held, and the explanation has ended with these values."""
    ended = {"state": state, "ended_at": now(), "owner": None, "lease_until_s": None, **NO_PAUSE, **values}
    return connection.execute(_held(claim).values(ended)).rowcount == 1


def wait_for_room(connection: Connection, claim: ExplanationClaim, first_pause_s: float) -> bool:
    """The disk was full, which is no fault of the explanation: where the claim still holds, this attempt does not
    count, and the pause until it is told of again doubles up to some minutes."""
    c = explanations.c
    waiting = {"state": "open", "attempts": c.attempts - 1, "owner": None, "lease_until_s": None}
    pause = {"pause_s": longer_pause(c.pause_s, first_pause_s), "announced_s": clock_s()}
    since = func.coalesce(c.waits_since, literal(now(), c.waits_since.type))
    return connection.execute(_held(claim).values(**waiting, **pause, waits_since=since)).rowcount == 1


def reopen_expired(connection: Connection, max_attempts: int, lease_s: float) -> Reopened:
    """Takes explanations back whose lease has ended; those that were tried too often are failed(worker_lost)."""
    lost = f"the worker was lost {counted_times(max_attempts)} while it worked on this explanation"
    failed = {"ended_at": now(), "error_code": "worker_lost", "error_text": lost, **NO_PAUSE}
    claimed = UNEXPLAINED & (explanations.c.state == "claimed")
    return take_back(connection, explanations, claimed, max_attempts, lease_s, failed, {"announced_s": None})


def to_announce(connection: Connection, stalled_s: float) -> list[int]:
    """Explanations that could be worked on and that nobody was told of lately, of one that found no room as long as its
    pause is; they count as told from now on."""
    quiet = long_ago(explanations.c.announced_s, func.coalesce(explanations.c.pause_s, stalled_s))
    found = connection.scalars(
        update(explanations).where(*_waiting(), quiet).values(announced_s=clock_s()).returning(explanations.c.id)
    )
    return sorted(found)


def any_waiting(connection: Connection) -> bool:
    """Whether one could be claimed now."""
    return connection.scalar(select(explanations.c.id).where(*_waiting()).limit(1)) is not None


def _waiting() -> tuple[ColumnElement[bool], ...]:
    """Of an explanation that could be worked on now. One that found no room too: where another one ended, there is room
    again."""
    return UNEXPLAINED, explanations.c.state == "open", _its_turn()


def _its_turn() -> ColumnElement[bool]:
    loops_wait = exists(select(audit_items.c.loop_id).where(audit_items.c.state == "open"))
    return or_(explanations.c.audit_id.is_(None), and_(explanations.c.audit_id.is_not(None), ~loops_wait))


def _held(claim: ExplanationClaim) -> Update:
    return update(explanations).where(
        explanations.c.id == claim.explanation_id,
        explanations.c.state == "claimed",
        explanations.c.owner == claim.owner,
        explanations.c.attempts == claim.attempt,
    )
