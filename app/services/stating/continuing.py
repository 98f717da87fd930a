"""A loop that goes on under another tag: it takes what was known of the one before, and that one is retired."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from difflib import SequenceMatcher
from typing import Any

from sqlalchemy import Connection

from app.errors import FieldError
from app.services.backend import Backend
from app.services.moments import span_ns
from app.storage import continuing as stored
from app.storage import loops
from app.storage.loops import SPANS, LoopRow
from app.storage.types import storable

CONTINUES = "continues"
TAKEN = ("unit", "type", "description", "owner", "pv_unit", "integrating", "moves_valve")
USUAL_IMPORTANCE = 1.0

NEW = timedelta(days=14)
"""So long after it appeared a loop is looked at as one that may have had another tag."""

BEFORE, AFTER = timedelta(hours=36), timedelta(hours=1)
"""The loop before stopped so long before the new one began, or after."""

ALIKE = 0.75


def check(connection: Connection, tag: str, earlier: str) -> LoopRow:
    """The loop that is continued. Raises FieldError("bad_continues") where there is none, or it cannot be that one."""
    row = loops.by_tag(connection, earlier) if storable(earlier) == earlier else None
    if row is None:
        raise FieldError("bad_continues", f"there is no loop {earlier[:60]!r} to continue", CONTINUES)
    if tag in (earlier, *stored.earlier_of(connection, [earlier]).get(earlier, ())):
        raise FieldError("bad_continues", f"{earlier[:60]!r} is {tag[:60]!r} itself, or continues it", CONTINUES)
    later = stored.later_of(connection, earlier)
    if later not in (None, tag):
        raise FieldError("bad_continues", f"{earlier[:60]!r} goes on as {later!r} already", CONTINUES)
    return row


def check_retired(connection: Connection, tag: str) -> None:
    """Raises FieldError("bad_continues") where a loop is to be in service that goes on under another tag: one loop
    would count twice."""
    if (later := stored.later_of(connection, tag)) is not None:
        text = f"it goes on as {later!r}: say of that one that it continues none"
        raise FieldError("bad_continues", text, CONTINUES)


def taken_over(values: Mapping[str, Any], earlier: LoopRow) -> dict[str, Any]:
    """What a loop takes of the one that it continues: all that nobody has said of it. A span is one value."""
    free = {name: getattr(earlier, name) for name in TAKEN if values[name] is None}
    for span in SPANS:
        if all(values[name] is None for name in span):
            free |= {name: getattr(earlier, name) for name in span}
    return free | ({"importance": earlier.importance} if values["importance"] == USUAL_IMPORTANCE else {})


def follow(connection: Connection, row: LoopRow, earlier: LoopRow | None) -> None:
    """After a loop was said to continue another one, or none: the other is retired, and what was written of it goes
    along; the one that it continued before is in service again, with its notes."""
    if row.continues is not None and (former := loops.by_tag(connection, row.continues)) is not None:
        chain = [former.tag, *stored.earlier_of(connection, [former.tag]).get(former.tag, ())]
        stored.move_notes(connection, row.id, former.id, chain)
        loops.change(connection, former.id, {"retired": False})
    if earlier is not None:
        stored.move_notes(connection, earlier.id, row.id, ())
        loops.change(connection, earlier.id, {"retired": True})


def goes_on_as(backend: Backend, tag: str) -> str | None:
    with backend.database.read() as connection:
        return stored.later_of(connection, tag)


def maybe_before(backend: Backend, tag: str) -> str | None:
    """The loop that this one may be, under a new tag: its tag is like this one's, and it stopped when this one began;
    None where there is none, or it has been said."""
    with backend.database.read() as connection:
        row = loops.by_tag(connection, tag)
        if row is None or row.continues is not None or row.retired:
            return None
        created = stored.created_at(connection, row.id)
        began = stored.began(connection, row.id)
        if began is None or created < datetime.now(UTC) - NEW:
            return None
        window = (began - span_ns(BEFORE), began + span_ns(AFTER))
        found = [one for one in stored.stopped_between(connection, *window, row.unit) if one != tag]
    alike = {one: likeness(one, tag) for one in found}
    best = max(alike, key=alike.__getitem__, default=None)
    return best if best is not None and alike[best] >= ALIKE else None


def likeness(one: str, other: str) -> float:
    """0 to 1; of FIC101 and FIC-101A it is more than of FIC101 and FIC102, which are two loops."""
    plain, second = ("".join(letter for letter in tag.casefold() if letter.isalnum()) for tag in (one, other))
    if _numbers(plain) != _numbers(second):
        return 0.0
    return SequenceMatcher(None, plain, second).ratio()


def _numbers(tag: str) -> str:
    return "".join(letter for letter in tag if letter.isdigit()).lstrip("0")
