"""Audit runs: planned, running, ended."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Select,
    and_,
    case,
    exists,
    func,
    insert,
    literal,
    or_,
    select,
    union_all,
    update,
)

from app.nanoseconds import NS_PER_S
from app.storage.bulk import insert_new
from app.storage.items import CANCELLED
from app.storage.locks import Lock, hold
from app.storage.loops import IN_SERVICE
from app.storage.tables import GOING_ON, audit_items, audits, in_words, loops, uploads
from app.storage.types import clock_s, long_ago, now

WITH_RESULTS = ("done", "partial")
"""States of a run that ended with what it could do: what it says of loops counts."""
ENDED = (*WITH_RESULTS, "cancelled")
"""States of a run that is not worked on any more."""
TO_DO = ("open", "claimed")
MANY = 1000
"""Loops of a run that are worth the tenth of a second in which PostgreSQL looks at the table anew."""


_MINE = audit_items.c.audit_id == audits.c.id
_COMPLETE = (GOING_ON, ~exists().where(_MINE, audit_items.c.state.in_(TO_DO)))


@dataclass(frozen=True)
class AuditRow:
    id: int
    trigger: str
    state: str
    nightly_for: str | None
    config_json: str
    config_fingerprint: str
    window_h: float
    window_samples: int
    created_at: datetime
    ended_at: datetime | None
    total: int
    started_by: str
    filter_json: str
    newest_ns: int | None


@dataclass(frozen=True)
class Progress:
    """How many loops of a run are in which state; `claimed` ones are being worked on, `cancelled` ones failed by being
    called off."""

    open: int = 0
    claimed: int = 0
    done: int = 0
    failed: int = 0
    cancelled: int = 0


@dataclass(frozen=True)
class LoopFilter:
    """Which loops to audit: all that are given must hold; nothing given is the whole plant. A loop that is retired is
    audited only where its tag is given."""

    tags: tuple[str, ...] | None = None
    unit: str | None = None
    type: str | None = None


WHOLE = json.dumps(vars(LoopFilter()))
"""How a run is stored that was asked for without a filter."""

COLUMNS = [audits.c[name] for name in AuditRow.__dataclass_fields__]


def plan(connection: Connection, values: dict[str, Any], wanted: LoopFilter) -> int | None:
    """A new run with an item for each of the loops that have samples; None where that night's run is there already."""
    start = insert_new(connection, audits).values(**values, created_at=now(), total=0).returning(audits.c.id)
    audit_id = connection.scalar(start)
    if audit_id is None:
        return None
    chosen = select(literal(audit_id), loops.c.id).where(*_conditions(wanted)).order_by(loops.c.id)
    connection.execute(insert(audit_items).from_select(["audit_id", "loop_id"], chosen))
    total = connection.scalar(select(func.count()).where(audit_items.c.audit_id == audit_id)) or 0
    ended = {"state": "done", "ended_at": now()} if total == 0 else {}
    connection.execute(update(audits).where(audits.c.id == audit_id).values(total=total, **ended))
    if total >= MANY and connection.dialect.name == "postgresql":
        # What is new lies beyond what the planner knows: it took the loops of a run for one and read all at each claim.
        connection.exec_driver_sql("ANALYZE (SKIP_LOCKED) audit_items")
    return audit_id


def by_id(connection: Connection, audit_id: int) -> AuditRow | None:
    row = connection.execute(select(*COLUMNS).where(audits.c.id == audit_id)).one_or_none()
    return None if row is None else AuditRow(*row)


def by_night(connection: Connection, plant: str, nightly_for: str) -> AuditRow | None:
    query = select(*COLUMNS).where(audits.c.plant == plant, audits.c.nightly_for == nightly_for)
    row = connection.execute(query).one_or_none()
    return None if row is None else AuditRow(*row)


def nights_dated_after(connection: Connection, plant: str, night: str, latest: datetime) -> list[AuditRow]:
    """The runs of this night and of later ones that began after `latest`, in the order of their nights; without those
    whose samples are later too: they come from other clocks, and it is ours that is behind."""
    c, latest_ns = audits.c, int(latest.timestamp()) * NS_PER_S
    ahead = (c.plant == plant, c.nightly_for >= night, c.created_at > latest, c.newest_ns <= latest_ns)
    return [AuditRow(*row) for row in connection.execute(select(*COLUMNS).where(*ahead).order_by(c.nightly_for))]


def let_go_of_night(connection: Connection, audit_id: int) -> None:
    """The run was not its date's night, which is to come: it stands beside it."""
    connection.execute(update(audits).where(audits.c.id == audit_id).values(nightly_for=None))


def of_a_night(*, the_first: bool = False) -> ColumnElement[bool]:
    """Runs of the whole plant as each night has one, whoever began them, those too that somebody asked for once that
    night's had ended; the_first: the one that a date's night is, without those."""
    return audits.c.nightly_for.is_not(None) if the_first else audits.c.trigger == "nightly"


def newest_night(
    connection: Connection, *, at_most_old: timedelta | None = None, passes_by: bool = False
) -> int | None:
    """The night that was planned last, where it has ended with results; at_most_old: and that not longer ago. While it
    goes on, or where it was cancelled, there is none: what follows a night waits for it. passes_by: one that goes on or
    was cancelled is passed by, for the last that has results."""
    nights = select(func.max(audits.c.id)).where(of_a_night())
    with_results = audits.c.state.in_(WITH_RESULTS)
    if passes_by:
        nights = nights.where(with_results)
    query = select(audits.c.id).where(audits.c.id == nights.scalar_subquery(), with_results)
    return connection.scalar(query if at_most_old is None else query.where(audits.c.ended_at > now() - at_most_old))


def newest_whole(connection: Connection) -> AuditRow | None:
    """The run of the whole plant that goes on, or else the newest one, of whatever state; one without loops is none."""
    query = select(*COLUMNS).where(of_the_whole_plant(), audits.c.total > 0)
    going_on_first = (GOING_ON.desc(), audits.c.id.desc())
    row = connection.execute(query.order_by(*going_on_first).limit(1)).one_or_none()
    return None if row is None else AuditRow(*row)


def whole_going_on(connection: Connection) -> int | None:
    """The run of the whole plant that goes on, unless samples have come since it began: loops that it is done with
    would lack them. Until the transaction has ended nobody else is told that there is none: of two who ask at once only
    one starts a run."""
    hold(connection, Lock.ONE_RUN)
    came_since = select(uploads.c.id).where(uploads.c.state == "done", uploads.c.ended_at > audits.c.created_at)
    going_on = select(audits.c.id).where(of_the_whole_plant(), GOING_ON, ~exists(came_since.correlate(audits)))
    return connection.scalar(going_on.order_by(audits.c.id.desc()).limit(1))


def of_the_whole_plant() -> ColumnElement[bool]:
    return or_(of_a_night(), audits.c.filter_json.in_((WHOLE, "{}")))


def page(connection: Connection, limit: int, before_id: int | None) -> list[AuditRow]:
    """Runs, the newest first."""
    query = select(*COLUMNS).order_by(audits.c.id.desc()).limit(limit)
    if before_id is not None:
        query = query.where(audits.c.id < before_id)
    return [AuditRow(*row) for row in connection.execute(query)]


def progress(connection: Connection, audit_ids: Sequence[int]) -> dict[int, Progress]:
    """By what is left to do and what failed, each found by an index of its own, however many loops are done: they are
    the rest. In one statement, between whose parts no loop changes its state."""
    items = audit_items.c
    mine, called_off = items.audit_id.in_(audit_ids), case((items.code == CANCELLED, "cancelled"), else_="failed")
    parts = (
        select(audits.c.id, literal("total").label("told"), audits.c.total).where(audits.c.id.in_(audit_ids)),
        _counted("open", literal("open")).where(mine),
        # Grouped by both: by the run alone SQLite reads the whole table in the order of its key.
        _counted("claimed", literal("claimed")).where(items.lease_until_s > 0).group_by("told"),
        _counted("failed", called_off).where(mine).group_by("told"),
    )
    counts: dict[int, dict[str, int]] = {audit_id: {} for audit_id in audit_ids}
    for audit_id, told, count in connection.execute(union_all(*parts)):
        if audit_id in counts:
            counts[audit_id][told] = count
    return {audit_id: _progress(found) for audit_id, found in counts.items()}


def _counted(state: str, told: ColumnElement[str]) -> Select[Any]:
    """Loops in this state by run."""
    query = select(audit_items.c.audit_id, told.label("told"), func.count()).group_by(audit_items.c.audit_id)
    return query.where(in_words(audit_items.c.state, state))


def _progress(found: dict[str, int]) -> Progress:
    """found: all loops of the run, and those in each state but done."""
    total = found.pop("total", 0)
    return Progress(**found, done=total - sum(found.values()))


def set_running(connection: Connection, audit_id: int) -> None:
    connection.execute(
        update(audits).where(audits.c.id == audit_id, audits.c.state == "planned").values(state="running")
    )


def complete(connection: Connection) -> list[int]:
    """The runs that have nothing left to do, and have not ended."""
    return list(connection.scalars(select(audits.c.id).where(*_COMPLETE).order_by(audits.c.id)))


def end_if_complete(connection: Connection, audit_id: int) -> bool:
    """Whether the run has ended by this, which it does with nothing left to do: done, partial where a loop failed, or
    cancelled where loops were called off."""
    failed = exists().where(_MINE, audit_items.c.state == "failed")
    called_off = exists().where(_MINE, audit_items.c.state == "failed", audit_items.c.code == CANCELLED)
    state = case((called_off, "cancelled"), (failed, "partial"), else_="done")
    ending = update(audits).where(audits.c.id == audit_id, *_COMPLETE).values(state=state, ended_at=now())
    return connection.execute(ending).rowcount == 1


def cancel(connection: Connection, audit_id: int) -> int:
    """How many loops of a run that has not ended are called off: they become failed(cancelled), whoever has claimed
    them, and the run has nothing left to do."""
    going_on = select(audits.c.id).where(audits.c.id == audit_id, GOING_ON)
    called_off = (
        update(audit_items)
        .where(audit_items.c.audit_id.in_(going_on), audit_items.c.state.in_(TO_DO))
        .values(state="failed", code=CANCELLED, text="the run was cancelled", owner=None, lease_until_s=None)
    )
    return connection.execute(called_off).rowcount


def to_announce(connection: Connection, stalled_s: float) -> list[int]:
    """Runs with open loops that nobody works on and nobody was told of lately; they count as told from now on."""
    mine = audit_items.c.audit_id == audits.c.id
    waiting = exists().where(mine, audit_items.c.state == "open")
    worked_on = exists().where(mine, audit_items.c.state == "claimed")
    quiet = long_ago(audits.c.announced_s, stalled_s)
    # Where some workers are at it, the run is only announced again after a good while: others may have died.
    very_quiet = long_ago(audits.c.announced_s, 3 * stalled_s)
    stalled = or_(and_(~worked_on, quiet), very_quiet)
    found = connection.scalars(
        update(audits).where(GOING_ON, waiting, stalled).values(announced_s=clock_s()).returning(audits.c.id)
    )
    return sorted(found)


def note_announced(connection: Connection, audit_id: int) -> None:
    connection.execute(update(audits).where(audits.c.id == audit_id).values(announced_s=clock_s()))


def note_called(connection: Connection, audit_id: int) -> None:
    """Whoever worked on the run has called a successor. One that is to be announced again stays so: others called
    nobody."""
    as_before = case((audits.c.announced_s > 0, clock_s()), else_=-clock_s())
    connection.execute(update(audits).where(audits.c.id == audit_id).values(announced_s=as_before))


def note_uncalled(connection: Connection, audit_id: int) -> None:
    """Whoever worked on the run could call nobody: the next sweep announces it again, where loops of it are open."""
    connection.execute(update(audits).where(audits.c.id == audit_id).values(announced_s=-clock_s()))


def _conditions(wanted: LoopFilter) -> list[Any]:
    conditions: list[Any] = [loops.c.newest_ns.is_not(None)]
    conditions.append(IN_SERVICE if wanted.tags is None else loops.c.tag.in_(wanted.tags))
    if wanted.unit is not None:
        conditions.append(loops.c.unit == wanted.unit)
    if wanted.type is not None:
        conditions.append(loops.c.type == wanted.type)
    return conditions
