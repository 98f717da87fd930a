"""Uploads that others overtook: received later, and with samples of the same loops at the same times."""

import json
from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, Connection, exists, func, or_, select

from app.nanoseconds import EVER_NS
from app.storage.tables import UNREAD, series, upload_loops, uploads

FEW_LOOPS = 50
"""Of so many loops all stretches that are newer can be looked at; of a plant's those of months take seconds."""


class _Span(NamedTuple):
    """From when to when the rows of a file are, ns since 1970 UTC."""

    start_ns: int
    end_ns: int


class _Asked(NamedTuple):
    """The upload, when its rows are, and between which numbers the others were received."""

    upload_id: int
    span: _Span
    after: int
    before: int

    def between(self, number: ColumnElement[int]) -> tuple[ColumnElement[bool], ...]:
        return number > self.after, number < self.before

    def met_by(self, summaries: Iterable[str | None]) -> bool:
        """Whether rows of one of them are of the same time."""
        spans = map(_span, summaries)
        return any(other.start_ns <= self.span.end_ns and other.end_ns >= self.span.start_ns for other in spans)


def is_overtaken(connection: Connection, upload_id: int, number: int, until: int = EVER_NS) -> bool:
    """Whether uploads received after this one of the number `number`, and before the one of `until`, brought samples of
    its loops at its times, or may be about to. A stretch holds only what was new when it came: files that overlap and
    agree do not overtake each other. Those whose receipts are dropped are not looked at: this one's would be, too, had
    it not come again after them."""
    told = connection.scalar(select(uploads.c.summary_json).where(uploads.c.id == upload_id))
    asked = _Asked(upload_id, _span(told), number, until)
    return _may_come(connection, asked) or _came(connection, asked)


def _came(connection: Connection, asked: _Asked) -> bool:
    mine = upload_loops.c.upload_id == asked.upload_id
    count = connection.scalar(select(func.count()).select_from(upload_loops).where(mine)) or 0
    if count > FEW_LOOPS and not asked.met_by(_read_since(connection, asked)):
        return False
    there = (series.c.end_ns >= asked.span.start_ns, series.c.start_ns <= asked.span.end_ns)
    such = (series.c.upload_id != asked.upload_id, *there, *asked.between(series.c.receipt_number))
    query = select(series.c.id).join(upload_loops, upload_loops.c.loop_id == series.c.loop_id)
    return connection.scalar(query.where(mine, *such).limit(1)) is not None


def _read_since(connection: Connection, asked: _Asked) -> Iterable[str | None]:
    """Of one that failed before it had any loop nothing came."""
    brought = or_(uploads.c.summary_json.is_not(None), exists().where(upload_loops.c.upload_id == uploads.c.id))
    others = (~UNREAD, brought, uploads.c.id != asked.upload_id, *asked.between(uploads.c.receipt_number))
    return connection.scalars(select(uploads.c.summary_json).where(*others)).all()


def _may_come(connection: Connection, asked: _Asked) -> bool:
    """Of one that is still to be read it is known what it has only where it was read to its end before."""
    theirs, mine = upload_loops.alias("theirs"), upload_loops.alias("mine")
    both = (theirs.c.loop_id == mine.c.loop_id, mine.c.upload_id == asked.upload_id)
    shared = exists().where(theirs.c.upload_id == uploads.c.id, *both)
    others = (UNREAD, uploads.c.id != asked.upload_id, or_(uploads.c.summary_json.is_(None), shared))
    query = select(uploads.c.summary_json).where(*others, *asked.between(uploads.c.receipt_number))
    return asked.met_by(connection.scalars(query).all())


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
