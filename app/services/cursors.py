"""Where a page ends, as a text that clients hand back and need not understand."""

import base64
import binascii
import json
import math
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Any, TypeVar

from app.errors import RequestError
from app.services.results import Page

LONGEST = 5000
"""Characters of a cursor: two names of 256 letters each, the longest an export has, escaped and in base 64."""
LARGEST = 2**63 - 1

Row = TypeVar("Row")
View = TypeVar("View")


def encode(*values: Any) -> str:
    marked = [{"t": value.isoformat()} if isinstance(value, datetime) else value for value in values]
    return base64.urlsafe_b64encode(json.dumps(marked, ensure_ascii=False).encode()).decode().rstrip("=")


def page_of(
    rows: Sequence[Row], limit: int, view: Callable[[Row], View], key: Callable[[Row], tuple[Any, ...]]
) -> Page[View]:
    """The first `limit` of rows, of which one more tells whether there are more. key: what the next ones come after."""
    shown = rows[:limit]
    return Page([view(row) for row in shown], encode(*key(shown[-1])) if len(rows) > limit else None)


def decode(cursor: str | None, kinds: tuple[type | tuple[type, ...], ...]) -> list[Any] | None:
    """The values that `encode` was given, each one that a database can be asked with; None for no cursor, or an empty
    one, as dashboards send for their first page.

    Raises RequestError("bad_cursor") for any other text.
    """
    if not cursor:
        return None
    try:
        padded = cursor[:LONGEST] + "=" * (-len(cursor) % 4)
        values = [_unmarked(value) for value in json.loads(base64.urlsafe_b64decode(padded.encode("ascii")))]
    except (binascii.Error, ValueError, TypeError, OverflowError, RecursionError) as error:
        raise refused(cursor) from error
    if len(values) != len(kinds) or not all(isinstance(v, k) for v, k in zip(values, kinds, strict=True)):
        raise refused(cursor)
    if not all(map(_plain, values)):
        raise refused(cursor)
    return values


def _unmarked(value: Any) -> Any:
    if isinstance(value, dict) and set(value) == {"t"}:
        return datetime.fromisoformat(value["t"]).astimezone(UTC)
    return value


def _plain(value: Any) -> bool:
    """Whether it is a value that both databases take: no container, no truth value, nothing beyond their ranges."""
    match value:
        case bool():
            return False
        case int():
            return abs(value) <= LARGEST
        case float():
            return math.isfinite(value)
        case str():
            return "\0" not in value and not any("\ud800" <= letter <= "\udfff" for letter in value)
        case _:
            return value is None or isinstance(value, datetime)


def refused(cursor: str) -> RequestError:
    return RequestError("bad_cursor", f"got the cursor {cursor[:40]!r}; pass on `next_cursor` of the page before")


def identifier(text: str) -> int:
    """The number behind an identifier; 0, which nothing has, for a text that is none."""
    return int(text) if text.isascii() and text.isdigit() and len(text) < 19 else 0
