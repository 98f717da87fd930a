"""Loops of which a repair was stated, with what was said of them before it and what a run said of them."""

from collections.abc import Collection
from dataclasses import dataclass
from datetime import datetime
from typing import NamedTuple

from sqlalchemy import ColumnElement, Connection, FromClause, ScalarSelect, and_, case, func, literal, select

from app.storage.bulk import among_many
from app.storage.loops import IN_SERVICE
from app.storage.notes import stands
from app.storage.tables import loops, notes, verdicts
from app.storage.types import UtcDateTime, whole_ms, whole_ms_ns

earlier, before = verdicts.alias("earlier"), verdicts.alias("before")


@dataclass(frozen=True)
class Sides:
    """The runs of a loop's last verdict before a repair, and of its newest one after it; None: there is none."""

    before: int | None
    after: int | None


class RepairRow(NamedTuple):
    """A repair of a loop, the verdict before it with its likely cause, and that of the run, or the newest one, which
    the others are of. side: of the repair on which that one lies, as `repair_sides.side_of` tells it."""

    tag: str
    unit: str | None
    repaired_at: datetime
    verdict_before: str | None
    cause_before: str | None
    verdict: str | None
    reliability: str | None
    likely_cause: str | None
    side: str | None


def sides(connection: Connection, loop_id: int, repaired_at: datetime) -> Sides:
    at = literal(repaired_at, UtcDateTime())
    runs = (_last_run(loop_id, of_side(verdicts, at)).label(name) for name, of_side in SIDES.items())
    return Sides(**connection.execute(select(*runs)).mappings().one())


def _last_run(loop_id: int, such: ColumnElement[bool]) -> ScalarSelect[int]:
    """From the newest verdict back to the first that is such a one, however many nights there are."""
    mine = select(verdicts.c.audit_id).where(verdicts.c.loop_id == loop_id, such)
    return mine.order_by(verdicts.c.audit_id.desc()).limit(1).scalar_subquery()


def judged_before(said: FromClause, repaired_at: ColumnElement[datetime]) -> ColumnElement[bool]:
    """Judged by what was recorded before the repair, to the millisecond, as `repair_sides.side_of` tells of the same
    span."""
    looked_at = case(
        (said.c.input_end_ns.is_not(None), said.c.input_end_ns < whole_ms_ns(repaired_at)),
        else_=said.c.audited_at < whole_ms(repaired_at),
    )
    judged = said.c.window_end < whole_ms(repaired_at)
    return case((said.c.window_end.is_not(None), judged), else_=looked_at)


def _judged_after(said: FromClause, repaired_at: ColumnElement[datetime]) -> ColumnElement[bool]:
    judged = said.c.window_start >= whole_ms(repaired_at)
    looked_at = said.c.input_start_ns >= whole_ms_ns(repaired_at)
    return case((said.c.window_start.is_not(None), judged), else_=looked_at)


SIDES = {"before": judged_before, "after": _judged_after}


def between(
    connection: Connection,
    since: datetime,
    until: datetime,
    audit_id: int | None,
    limit: int,
    tags: Collection[str] | None = None,
) -> list[RepairRow]:
    """The loops with a repair in that time, with the verdict of the run, for loops that it audited; without one with
    the loop's newest, None where it has none. The weightiest first. tags: of these loops alone.

    Of each loop the note that was written last counts, as for the audit.
    """
    run = loops.c.newest_audit_id if audit_id is None else literal(audit_id)
    standing = and_(notes.c.repaired_at.is_not(None), stands(notes, until))
    last = select(func.max(notes.c.id).label("id")).where(standing).group_by(notes.c.loop_id).subquery()
    last_before = (
        select(earlier.c.audit_id)
        .where(earlier.c.loop_id == notes.c.loop_id, earlier.c.audit_id <= run)
        .where(judged_before(earlier, notes.c.repaired_at))
        .order_by(earlier.c.audit_id.desc())
        .limit(1)
        .correlate(notes, loops)
        .scalar_subquery()
    )
    mine = and_(before.c.loop_id == notes.c.loop_id, before.c.audit_id == last_before)
    sides = [(of_side(verdicts, notes.c.repaired_at), name) for name, of_side in SIDES.items()]
    said = and_(verdicts.c.loop_id == notes.c.loop_id, verdicts.c.audit_id == run)
    query = (
        select(
            loops.c.tag,
            loops.c.unit,
            notes.c.repaired_at,
            before.c.verdict.label("verdict_before"),
            before.c.likely_cause.label("cause_before"),
            verdicts.c.verdict,
            verdicts.c.reliability,
            verdicts.c.likely_cause,
            case(*sides).label("side"),
        )
        .select_from(notes)
        .join(last, last.c.id == notes.c.id)
        .join(loops, loops.c.id == notes.c.loop_id)
        .join(verdicts, said, isouter=audit_id is None)
        .join(before, mine, isouter=True)
        .where(notes.c.repaired_at > since, notes.c.repaired_at <= until, IN_SERVICE)
        .order_by(loops.c.importance.desc(), notes.c.repaired_at.desc(), loops.c.tag)
        .limit(limit)
    )
    query = query if tags is None else query.where(among_many(connection, loops.c.tag, tags))
    return [RepairRow._make(row) for row in connection.execute(query)]
