"""Loops whose PV does not answer OP, as their verdicts tell of it; of a plant in which all answer nothing is read."""

from typing import Any

from sqlalchemy import Connection, and_, select

from app.engine.codes import UNANSWERED
from app.storage.loops import IN_SERVICE
from app.storage.newest import NEWEST_ROWS, is_newest, worst_first
from app.storage.tables import loops, newest_rows, verdicts


def unanswered(connection: Connection) -> list[Any]:
    """Of all loops in service by their newest verdict: what it tells of when that began, and what the verdict before it
    told, where that was the same."""
    before = verdicts.alias("before")
    same = (before.c.audit_id == newest_rows.c.before_audit_id, before.c.likely_cause == UNANSWERED)
    told = (
        *(loops.c.tag, loops.c.unit, newest_rows.c.audit_id, verdicts.c.reasons, verdicts.c.extra_json),
        *(verdicts.c.sampling_interval_s, verdicts.c.input_start_ns, verdicts.c.input_end_ns),
        before.c.extra_json.label("extra_json_before"),
    )
    joined = NEWEST_ROWS.join(verdicts, is_newest(verdicts))
    joined = joined.outerjoin(before, and_(before.c.loop_id == loops.c.id, *same))
    query = select(*told).select_from(joined).where(IN_SERVICE, newest_rows.c.likely_cause == UNANSWERED)
    return list(connection.execute(query.order_by(loops.c.tag)))


def stood_together(connection: Connection, reason: str, audit_id: int | None = None) -> list[Any]:
    """Those of which the newest verdict, or that of a run, gives this reason first; the weightiest first."""
    end = loops.c.newest_ns if audit_id is None else verdicts.c.input_end_ns
    told = (
        *(loops.c.id, loops.c.tag, loops.c.unit, end.label("end_ns")),
        *(verdicts.c.sampling_interval_s, verdicts.c.extra_json),
    )
    if audit_id is None:
        source = NEWEST_ROWS.join(verdicts, is_newest(verdicts))
        mine = newest_rows.c.likely_cause == UNANSWERED
    else:
        source = loops.join(verdicts, verdicts.c.loop_id == loops.c.id)
        mine = and_(verdicts.c.audit_id == audit_id, verdicts.c.likely_cause == UNANSWERED)
    query = select(*told).select_from(source).where(IN_SERVICE, mine, verdicts.c.reasons.startswith(reason))
    return list(connection.execute(query.order_by(*worst_first(verdicts))))
