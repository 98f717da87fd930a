"""One loop in one run: claimed for a time, then done or failed; given to another where its worker is lost."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Select, Update, and_, bindparam, func, or_, select, update

from app.counting import counted_times
from app.storage.bulk import among
from app.storage.leases import Reopened, take_back
from app.storage.tables import GOING_ON, audit_items, audits, loops
from app.storage.types import clock_s

CANCELLED = "cancelled"
"""The code of loops that were called off with their run."""


@dataclass(frozen=True)
class Claim:
    """The right to write the result of a loop, until the lease ends; `attempt` fences off whoever had it before."""

    audit_id: int
    loop_id: int
    attempt: int
    owner: str


@dataclass(frozen=True)
class Failure:
    claim: Claim
    code: str
    text: str


@dataclass(frozen=True)
class FailureRow:
    tag: str
    code: str
    text: str


def claim(connection: Connection, audit_id: int, owner: str, count: int, lease_s: float) -> list[Claim]:
    """Up to `count` loops of the run that are open, for `lease_s` seconds by the database's clock.

    A loop that was tried before is claimed alone: if it takes its worker down, it takes no other loop with it.
    """
    going_on = select(audits.c.id).where(audits.c.id == audit_id, GOING_ON)
    open_items = (
        select(audit_items.c.loop_id)
        .where(audit_items.c.audit_id == going_on.scalar_subquery(), audit_items.c.state == "open")
        .with_for_update(of=audit_items, skip_locked=True)
    )
    fresh = open_items.where(audit_items.c.attempts == 0).order_by(audit_items.c.loop_id).limit(count)
    tried = open_items.where(audit_items.c.attempts > 0).order_by(audit_items.c.attempts).limit(1)
    return _take(connection, audit_id, owner, fresh, lease_s) or _take(connection, audit_id, owner, tried, lease_s)


def renew(connection: Connection, claims: Sequence[Claim], lease_s: float) -> int:
    """How many of the claims still hold; their lease starts anew."""
    if not claims:
        return 0
    return connection.execute(_held(connection, claims).values(lease_until_s=clock_s() + lease_s)).rowcount


def hand_back(connection: Connection, claims: Sequence[Claim]) -> int:
    """How many of the claims still held; their loops, which nobody began to audit, are open as if nobody had claimed
    them."""
    if not claims:
        return 0
    as_before = {"state": "open", "owner": None, "lease_until_s": None, "attempts": audit_items.c.attempts - 1}
    return connection.execute(_held(connection, claims).values(as_before)).rowcount


def finish(connection: Connection, claims: Sequence[Claim]) -> set[int]:
    """The loops whose claim still holds, now done: only their results may be written, in the same transaction."""
    if not claims:
        return set()
    ended = _held(connection, claims).values(state="done", owner=None, lease_until_s=None, code=None, text=None)
    return set(connection.scalars(ended.returning(audit_items.c.loop_id)))


def fail(connection: Connection, failures: Sequence[Failure]) -> None:
    """Sets loops aside with the reason, where the claim still holds."""
    if not failures:
        return
    one = (
        update(audit_items)
        .where(
            audit_items.c.audit_id == bindparam("of_audit"),
            audit_items.c.loop_id == bindparam("of_loop"),
            audit_items.c.attempts == bindparam("attempt"),
            audit_items.c.owner == bindparam("held_by"),
            audit_items.c.state == "claimed",
        )
        .values(state="failed", owner=None, lease_until_s=None, code=bindparam("why"), text=bindparam("because"))
    )
    connection.execute(one, [_failed(failure) for failure in failures])


def reopen_expired(connection: Connection, max_attempts: int, lease_s: float, audit_id: int | None = None) -> Reopened:
    """Takes loops back whose lease has ended; those that were tried too often are failed(worker_lost). audit_id: those
    of this run alone. Each task has an owner of its own: `lost` tells how many of each run have no successor."""
    text = f"the worker was lost {counted_times(max_attempts)} while it audited this loop"
    claimed = audit_items.c.state == "claimed"
    if audit_id is not None:
        claimed &= audit_items.c.audit_id == audit_id
    lost = {"code": "worker_lost", "text": text}
    return take_back(connection, audit_items, claimed, max_attempts, lease_s, lost, run=audit_items.c.audit_id)


def count_open(connection: Connection, at_most: int) -> int:
    """Loops that wait for their audit, in all runs; counted no further than asked for."""
    waiting = select(audit_items.c.loop_id).where(audit_items.c.state == "open").limit(at_most).subquery()
    return connection.scalar(select(func.count()).select_from(waiting)) or 0


def failures(connection: Connection, audit_id: int, limit: int) -> list[FailureRow]:
    """The first of a run's failed loops, in the order in which the loops came in; those that were called off last."""
    query = (
        select(loops.c.tag, audit_items.c.code, audit_items.c.text)
        .join(loops, loops.c.id == audit_items.c.loop_id)
        .where(audit_items.c.audit_id == audit_id, audit_items.c.state == "failed")
        .order_by(audit_items.c.code == CANCELLED, audit_items.c.loop_id)
        .limit(limit)
    )
    return [FailureRow(*row) for row in connection.execute(query)]


def newest_failure(connection: Connection, loop_id: int, after: int) -> tuple[int, str] | None:
    """The newest run after run `after` in which this audit failed, and why; one that was called off has not."""
    query = (
        select(audit_items.c.audit_id, audit_items.c.text)
        .where(audit_items.c.loop_id == loop_id, audit_items.c.state == "failed", audit_items.c.audit_id > after)
        .where(audit_items.c.code != CANCELLED)
        .order_by(audit_items.c.audit_id.desc())
        .limit(1)
    )
    found = connection.execute(query).first()
    return None if found is None else (found.audit_id, found.text)


def _take(connection: Connection, audit_id: int, owner: str, chosen: Select[Any], lease_s: float) -> list[Claim]:
    # Two statements: in one, PostgreSQL compared each open loop of the run with those picked, at every claim anew.
    picked = connection.scalars(chosen).all()
    if not picked:
        return []
    taken = connection.execute(
        update(audit_items)
        .where(audit_items.c.audit_id == audit_id, among(connection, audit_items.c.loop_id, picked))
        .values(state="claimed", owner=owner, lease_until_s=clock_s() + lease_s, attempts=audit_items.c.attempts + 1)
        .returning(audit_items.c.loop_id, audit_items.c.attempts)
    )
    return sorted((Claim(audit_id, row.loop_id, row.attempts, owner) for row in taken), key=lambda c: c.loop_id)


def _held(connection: Connection, claims: Sequence[Claim]) -> Update:
    """Items of one owner in one run whose attempt is still theirs."""
    by_attempt: dict[int, list[int]] = {}
    for one in claims:
        by_attempt.setdefault(one.attempt, []).append(one.loop_id)
    theirs = [
        and_(audit_items.c.attempts == attempt, among(connection, audit_items.c.loop_id, loop_ids))
        for attempt, loop_ids in by_attempt.items()
    ]
    return update(audit_items).where(
        audit_items.c.audit_id == claims[0].audit_id,
        audit_items.c.owner == claims[0].owner,
        audit_items.c.state == "claimed",
        or_(*theirs),
    )


def _failed(failure: Failure) -> dict[str, Any]:
    return {
        "of_audit": failure.claim.audit_id,
        "of_loop": failure.claim.loop_id,
        "attempt": failure.claim.attempt,
        "held_by": failure.claim.owner,
        "why": failure.code,
        "because": failure.text[:2000],
    }
