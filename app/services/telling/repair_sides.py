"""On which side of a repair a verdict lies: whatever is said of a repair rests on this."""

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any

from app.engine.codes import ReasonCode
from app.services.moments import FIRST_DATED, epoch_ms
from app.services.telling.wording import codes_of

SINCE_REPAIR: ReasonCode = "since_repair"
BEFORE_REPAIR: ReasonCode = "before_repair"


Span = tuple[datetime | None, datetime | None]


def span_of(row: Mapping[str, Any]) -> Span:
    """From when to when a row of the reliability table tells of its loop: the window that was judged, or, without one,
    all that was looked at, or, where that was not kept, up to when it was made."""
    names = ("window_start", "window_end") if row.get("window_end") else ("input_start", "input_end")
    start, end = (_moment(row.get(name)) for name in names)
    return start, end or _moment(row.get("audited_at"))


def _moment(iso: str | None) -> datetime | None:
    return datetime.fromisoformat(iso) if iso else None


def side_of(span: Span, repaired_at: datetime) -> str | None:
    """On which side of a repair a span lies, "before" or "after", to the millisecond; None: on both, or there is
    none."""
    start, end, at = *map(epoch_ms, span), epoch_ms(repaired_at) or 0
    if start is not None and start >= at:
        return "after"
    return "before" if end is not None and end < at else None


def of_before(row: Mapping[str, Any], repaired_at: str | None) -> bool:
    """Whether what a row of the reliability table says is of before the loop's repair (ISO 8601)."""
    if BEFORE_REPAIR in codes_of(row):
        return True
    return repaired_at is not None and side_of(span_of(row), datetime.fromisoformat(repaired_at)) == "before"


def explained_before(explanation: Mapping[str, Any], repaired_at: str | None) -> bool:
    """Whether what an explanation is of was recorded before the loop's repair (ISO 8601)."""
    if repaired_at is None:
        return False
    start, end = (_moment(explanation.get(name)) for name in ("window_start", "window_end"))
    return side_of((start, end), datetime.fromisoformat(repaired_at)) == "before"


def explained_long_before(explanation: Mapping[str, Any], row: Mapping[str, Any], hold_days: float) -> bool:
    """Whether what an explanation is of ended more than `hold_days` before that begins which a row of the reliability
    table tells of. How old a record without a date is, is not known."""
    end, start = _moment(explanation.get("window_end")), span_of(row)[0]
    if end is None or start is None or end < FIRST_DATED:
        return False
    return (start - end) / timedelta(days=1) > hold_days
