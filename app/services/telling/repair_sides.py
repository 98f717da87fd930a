"""On which side of a repair a judged window lies: whatever is said of a repair rests on this."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from app.engine.codes import ReasonCode
from app.services.moments import epoch_ms
from app.services.telling.wording import codes_of

SINCE_REPAIR: ReasonCode = "since_repair"
BEFORE_REPAIR: ReasonCode = "before_repair"


def side_of(window_start: datetime | None, window_end: datetime | None, repaired_at: datetime) -> str | None:
    """On which side of a repair a judged window lies, "before" or "after", to the millisecond; None: on both, or there
    is none."""
    start, end, at = epoch_ms(window_start), epoch_ms(window_end), epoch_ms(repaired_at) or 0
    if start is not None and start >= at:
        return "after"
    return "before" if end is not None and end < at else None


def of_before(row: Mapping[str, Any], repaired_at: str | None) -> bool:
    """Whether what a row of the reliability table says is of before the loop's repair (ISO 8601)."""
    if BEFORE_REPAIR in codes_of(row):
        return True
    start, end = (row.get(name) and datetime.fromisoformat(row[name]) for name in ("window_start", "window_end"))
    return repaired_at is not None and side_of(start, end, datetime.fromisoformat(repaired_at)) == "before"
