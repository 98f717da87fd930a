"""Loops whose PV does not answer OP, as their verdicts tell of it; of a plant in which all answer nothing is read."""

from collections.abc import Collection
from typing import NamedTuple

from sqlalchemy import ColumnElement, Connection, FromClause, and_, select

from app.engine.codes import UNANSWERED
from app.storage.bulk import among_many
from app.storage.loops import IN_SERVICE
from app.storage.newest import NEWEST_ROWS, is_newest, last_of, worst_first
from app.storage.tables import loops, newest_rows, verdicts

NIGHTS_BACK = 14
"""Verdicts of a loop that are read back, at most: the end of a run writes on what they know, unless it fails, or a run
that began later has judged the loop by then."""


class UnansweredRow(NamedTuple):
    """A loop whose PV does not answer OP by its newest verdict: the record that this is of, and what it tells."""

    tag: str
    unit: str | None
    loop_id: int
    reasons: str
    extra_json: str
    sampling_interval_s: float | None
    input_start_ns: int | None
    input_end_ns: int | None


class SaidBefore(NamedTuple):
    """The same of an earlier verdict of a loop."""

    loop_id: int
    extra_json: str
    input_start_ns: int | None
    input_end_ns: int | None


class StoodRow(NamedTuple):
    """A loop whose PV came to stand with others, by one of its verdicts, which is said where the sampling interval is
    known; end_ns: its newest sample."""

    id: int
    tag: str
    unit: str | None
    end_ns: int | None
    audit_id: int
    sampling_interval_s: float
    extra_json: str


def unanswered(connection: Connection) -> list[UnansweredRow]:
    """Of all loops in service by their newest verdict: of which record it is, and what it tells of when that began."""
    told = (
        *(loops.c.tag, loops.c.unit, verdicts.c.loop_id, verdicts.c.reasons, verdicts.c.extra_json),
        *(verdicts.c.sampling_interval_s, verdicts.c.input_start_ns, verdicts.c.input_end_ns),
    )
    query = select(*told).select_from(NEWEST_ROWS.join(verdicts, is_newest(verdicts)))
    query = query.where(IN_SERVICE, newest_rows.c.likely_cause == UNANSWERED)
    return [UnansweredRow._make(row) for row in connection.execute(query.order_by(loops.c.tag))]


def unanswered_before(connection: Connection, loop_ids: Collection[int]) -> list[SaidBefore]:
    """Of these loops the newest NIGHTS_BACK verdicts before their newest that said the same, the newest first."""
    if not loop_ids:
        return []
    lasts, theirs = last_of(NIGHTS_BACK, among_many(connection, loops.c.id, loop_ids), _said_the_same_before)
    query = select(*(verdicts.c[name] for name in SaidBefore._fields)).join_from(lasts, verdicts, theirs)
    query = query.order_by(verdicts.c.loop_id, verdicts.c.audit_id.desc())
    return [SaidBefore._make(row) for row in connection.execute(query)]


def _said_the_same_before(said: FromClause, of: FromClause) -> tuple[ColumnElement[bool], ...]:
    return said.c.likely_cause == UNANSWERED, said.c.audit_id < of.c.newest_audit_id


def stood_together(connection: Connection, reason: str, audit_id: int | None = None) -> list[StoodRow]:
    """Those of which the newest verdict, or that of a run, gives this reason first; the weightiest first."""
    end = loops.c.newest_ns if audit_id is None else verdicts.c.input_end_ns
    told = (
        *(loops.c.id, loops.c.tag, loops.c.unit, end.label("end_ns")),
        *(verdicts.c.audit_id, verdicts.c.sampling_interval_s, verdicts.c.extra_json),
    )
    if audit_id is None:
        source = NEWEST_ROWS.join(verdicts, is_newest(verdicts))
        mine = newest_rows.c.likely_cause == UNANSWERED
    else:
        source = loops.join(verdicts, verdicts.c.loop_id == loops.c.id)
        mine = and_(verdicts.c.audit_id == audit_id, verdicts.c.likely_cause == UNANSWERED)
    query = select(*told).select_from(source).where(IN_SERVICE, mine, verdicts.c.reasons.startswith(reason))
    return [StoodRow._make(row) for row in connection.execute(query.order_by(*worst_first(verdicts)))]
