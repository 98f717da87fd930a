"""Uploads that others overtook: received later, and with samples of the same loops at the same times."""

import json
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, Connection, exists, or_, select

from app.nanoseconds import EVER_NS
from app.storage.tables import UNREAD, series, upload_loops, uploads


class _Span(NamedTuple):
    """From when to when the rows of a file are, ns since 1970 UTC."""

    start_ns: int
    end_ns: int


def is_overtaken(connection: Connection, upload_id: int, number: int, until: int = EVER_NS) -> bool:
    """Whether uploads received after this one of the number `number`, and before the one of `until`, brought samples of
    its loops at its times, or may be about to. A stretch holds only what was new when it came: files that overlap and
    agree do not overtake each other."""
    told = connection.scalar(select(uploads.c.summary_json).where(uploads.c.id == upload_id))
    between = (number, until)
    return _may_come(connection, upload_id, _span(told), between) or _came(connection, upload_id, _span(told), between)


def _came(connection: Connection, upload_id: int, span: _Span, numbers: tuple[int, int]) -> bool:
    mine = (upload_loops.c.upload_id == upload_id, or_(series.c.upload_id.is_(None), series.c.upload_id != upload_id))
    there = (series.c.end_ns >= span.start_ns, series.c.start_ns <= span.end_ns)
    query = select(series.c.id).join(upload_loops, upload_loops.c.loop_id == series.c.loop_id)
    return connection.scalar(query.where(*mine, *there, *_after(series.c.receipt_number, numbers)).limit(1)) is not None


def _may_come(connection: Connection, upload_id: int, span: _Span, numbers: tuple[int, int]) -> bool:
    """Of one that was never read it is not known what it has."""
    return any(
        other.start_ns <= span.end_ns and other.end_ns >= span.start_ns
        for other in _unread_spans(connection, upload_id, numbers)
    )


def _unread_spans(connection: Connection, upload_id: int, numbers: tuple[int, int]) -> Iterator[_Span]:
    """Of those that are still to be read, without those that were read to their end before and have no loop of it."""
    theirs, mine = upload_loops.alias("theirs"), upload_loops.alias("mine")
    shared = exists().where(
        theirs.c.upload_id == uploads.c.id, mine.c.loop_id == theirs.c.loop_id, mine.c.upload_id == upload_id
    )
    others = (UNREAD, uploads.c.id != upload_id, or_(uploads.c.summary_json.is_(None), shared))
    query = select(uploads.c.summary_json).where(*others, *_after(uploads.c.receipt_number, numbers))
    return map(_span, connection.scalars(query))


def _after(number: ColumnElement[int], numbers: tuple[int, int]) -> tuple[ColumnElement[bool], ...]:
    return number > numbers[0], number < numbers[1]


def _span(summary_json: str | None) -> _Span:
    """All time, where it is not told."""
    told: dict[str, Any] = json.loads(summary_json) if summary_json else {}
    first, last = told.get("times_from"), told.get("times_to")
    if first is None or last is None:
        return _Span(-EVER_NS, EVER_NS)
    return _Span(_ns(first), _ns(last) + 1_000_000)  # what is below a millisecond is not told


def _ns(iso: str) -> int:
    since = datetime.fromisoformat(iso) - datetime.fromisoformat("1970-01-01T00:00:00+00:00")
    return since // timedelta(microseconds=1) * 1000
