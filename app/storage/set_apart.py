"""Verdicts that could be relied on when they were made, and of which their rows say that they are of an old record, or
of before a repair that was stated since."""

from datetime import datetime
from typing import Any, Literal, NamedTuple

from sqlalchemy import ColumnElement, Connection, FromClause, and_, case, func, select

from app.storage.loops import IN_SERVICE
from app.storage.newest import NEWEST_ROWS
from app.storage.notes import stands
from app.storage.repaired import judged_before
from app.storage.tables import audits, loops, newest_rows, notes, verdicts
from app.storage.types import whole_ms_ns

Why = Literal["before_repair", "old_record"]


class OldFrom(NamedTuple):
    """By what a record is an old one, in nanoseconds, as `recency.of_old_record` has it."""

    late: int
    of_the_past: int
    dated: int


class SetApart(NamedTuple):
    """How many loops of a unit with one kind of verdict are set apart, and why."""

    unit: str | None
    verdict: str
    why: Why
    loops: int


def of_newest(connection: Connection, old: OldFrom) -> list[SetApart]:
    """Of the newest verdicts of loops in service, by what is written now."""
    return _counted(connection, newest_rows, NEWEST_ROWS, old, None)


def of_run(
    connection: Connection,
    audit_id: int,
    old: OldFrom,
    until: datetime | None,
    counts: ColumnElement[bool] = IN_SERVICE,
) -> list[SetApart]:
    """The same of one run, by what was written until then (None: by now). counts: of which loops."""
    mine = and_(verdicts.c.loop_id == loops.c.id, verdicts.c.audit_id == audit_id)
    return _counted(connection, verdicts, loops.join(verdicts, mine), old, until, counts)


def _counted(
    connection: Connection,
    said: FromClause,
    source: FromClause,
    old: OldFrom,
    until: datetime | None,
    counts: ColumnElement[bool] = IN_SERVICE,
) -> list[SetApart]:
    standing = and_(notes.c.repaired_at.is_not(None), stands(notes, until))
    last = select(func.max(notes.c.id).label("id"), notes.c.loop_id).where(standing).group_by(notes.c.loop_id)
    repair = last.subquery("last_repair")
    source = source.join(audits, audits.c.id == said.c.audit_id)
    source = source.outerjoin(repair, repair.c.loop_id == loops.c.id).outerjoin(notes, notes.c.id == repair.c.id)
    why: ColumnElement[Any] = case(
        (judged_before(said, notes.c.repaired_at), "before_repair"), (_of_old_record(said, old), "old_record")
    )
    relied = select(loops.c.unit, said.c.verdict, why.label("why")).select_from(source)
    apart = relied.where(said.c.reliability == "reliable", counts).subquery()
    by = (apart.c.unit, apart.c.verdict, apart.c.why)
    query = select(*by, func.count()).where(apart.c.why.is_not(None)).group_by(*by)
    return [SetApart._make(row) for row in connection.execute(query)]


def _of_old_record(said: FromClause, old: OldFrom) -> ColumnElement[bool]:
    at_work = audits.c.newest_ns >= whole_ms_ns(audits.c.created_at) - old.of_the_past
    ends = said.c.input_end_ns
    return and_(at_work, ends >= old.dated, ends < audits.c.newest_ns - old.late)
