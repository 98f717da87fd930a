"""Of which time verdicts are: the window that was judged, and how far what the engine was given reaches beyond it."""

from collections.abc import Sequence
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import Connection, Select, and_, func, select

from app.storage.loops import IN_SERVICE
from app.storage.newest import priority, worst_first
from app.storage.tables import loops, newest_rows, verdicts

now = verdicts.alias("judged_now")
before = verdicts.alias("judged_before")


class SpanRow(NamedTuple):
    """The window that a verdict is of, the newest sample that the engine was given, and the codes of its reasons."""

    tag: str
    loop_id: int
    window_start: datetime | None
    window_end: datetime | None
    input_end_ns: int | None
    reasons: str | None


class NoFurther(NamedTuple):
    """end_before, given_before: window_end and input_end_ns of the verdict before."""

    span: SpanRow
    unit: str | None
    verdict: str
    reliability: str
    end_before: datetime | None
    given_before: int | None


_SPAN = (now.c.loop_id, now.c.window_start, now.c.window_end, now.c.input_end_ns, now.c.reasons)


def spans(connection: Connection, tags: Sequence[str], audit_id: int | None = None) -> list[SpanRow]:
    """Of the newest verdict of each of these loops, or that of one run."""
    run = now.c.audit_id == (loops.c.newest_audit_id if audit_id is None else audit_id)
    query = select(loops.c.tag, *_SPAN).join(now, and_(now.c.loop_id == loops.c.id, run))
    return [SpanRow._make(row) for row in connection.execute(query.where(loops.c.tag.in_(tags)))]


def no_further(connection: Connection, run: int, and_since: bool, most: int) -> list[NoFurther]:
    """Loops that were given newer samples in `run` (and_since: or later) than before it, and whose judged window ends
    where it did. Looked for among the `most` that lack most to full health, times their importance.
    """
    picked = _heaviest(run, and_since).limit(most).subquery()
    earlier = (
        select(func.max(before.c.audit_id))
        .where(before.c.loop_id == picked.c.loop_id, before.c.audit_id < run)
        .correlate(picked)
        .scalar_subquery()
    )
    shown = (picked.c.tag, *_SPAN, picked.c.unit, now.c.verdict, now.c.reliability)
    query = (
        select(*shown, before.c.window_end.label("end_before"), before.c.input_end_ns.label("given_before"))
        .select_from(picked)
        .join(now, and_(now.c.loop_id == picked.c.loop_id, now.c.audit_id == picked.c.audit_id))
        .join(before, and_(before.c.loop_id == picked.c.loop_id, before.c.audit_id == earlier))
        .where(now.c.window_end == before.c.window_end, now.c.input_end_ns > before.c.input_end_ns)
    )
    ordered = query.order_by(picked.c.priority.desc().nulls_last(), picked.c.tag)
    of_span = len(SpanRow._fields)
    return [NoFurther(SpanRow._make(row[:of_span]), *row[of_span:]) for row in connection.execute(ordered)]


def _heaviest(run: int, and_since: bool) -> Select[Any]:
    """The narrow rows alone are sorted: the wide ones are read for those that are picked."""
    said = newest_rows if and_since else verdicts
    of_run = said.c.audit_id >= run if and_since else said.c.audit_id == run
    query = select(loops.c.tag, loops.c.unit, said.c.loop_id, said.c.audit_id, priority(said).label("priority"))
    query = query.join(said, said.c.loop_id == loops.c.id).where(of_run, IN_SERVICE)
    return query.order_by(*worst_first(said))
