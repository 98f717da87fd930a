"""The loops that are looked at first: those that want it today, and the worst of the others.

The worst are everywhere those that lack most to full health, times their importance. The page of the plant asks it of
all loops that were judged, because who sits before it mends tuning and transmitters too, and of those whose valves
stick reliably before the others. What could not be audited has a count of its own: that nothing is known of a valve is
no evidence against it. A report or a digest sends people to valves: they ask it of those loops alone that stick, may,
or show no answer of PV to OP, unit by unit, and say so.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import groupby
from typing import Any, TypeVar

from app.engine.codes import NO_ANSWER_VERDICTS, UNANSWERED
from app.services.audit_json.rows import OLD
from app.services.backend import Backend
from app.services.moments import PlantClock
from app.services.plant.changes import Changes
from app.services.plant.reliability import table
from app.services.plant.stood_together import ALONE, AsOne, as_one
from app.services.stating.shelving import Shelf, shelf
from app.storage import plant, verdicts
from app.storage.asked_rows import RowFilter

Listed = TypeVar("Listed")

JUDGED = ("stiction", "inconclusive", "no_stiction")
WORST = 12
MOST_TODAY = 200


def listed_first(
    backend: Backend,
    since_ns: int | None,
    changed: Changes | None = None,
    shelved: Shelf | None = None,
    together: AsOne | None = None,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """What the plant's page lists at its head: the loops to look at today, and the worst of the others. together: those
    that are told of as one (None: as is stored)."""
    known = shelf(backend) if shelved is None else shelved
    told = as_one(backend, known, since_ns=since_ns) if together is None else together
    today = look_today(backend, changed, since_ns, known, told)
    beside = {row["loop"] for row in today}
    return today, worst(backend, beside=beside, since_ns=since_ns, shelved=known, together=told)


def worst_tags(backend: Backend, since_ns: int | None, shelved: Shelf) -> list[str]:
    """The tags of what `listed_first` lists as the worst, in its order, from the narrow rows alone."""
    left_out = (*shelved.left_out, *as_one(backend, shelved, since_ns=since_ns).left_out)
    with backend.database.read() as connection:

        def first(limit: int, asked: RowFilter) -> list[str]:
            wanted = replace(asked, left_out=left_out)
            return [row.tag for row in verdicts.sent_rows(connection, limit, "priority", True, wanted, None)]

        today = set(first(MOST_TODAY, asked_today(since_ns)))
        return _sticking_first(first, RowFilter(recorded_from_ns=since_ns), today, WORST, lambda tag: tag)


def _sticking_first(
    listed: Callable[[int, RowFilter], list[Listed]],
    asked: RowFilter,
    beside: Collection[str],
    limit: int,
    tag_of: Callable[[Listed], str],
) -> list[Listed]:
    """Those of the judged loops that stick reliably, then the others, each as they are `listed`."""
    judged = replace(asked, verdict=JUDGED)
    reliably = replace(judged, verdict=("stiction",), reliability="reliable")
    found = [one for one in listed(limit + len(beside), reliably) if tag_of(one) not in beside][:limit]
    if len(found) < limit:
        left_out = {*beside, *map(tag_of, found)}
        others = listed(limit + len(left_out), judged)
        found += [one for one in others if tag_of(one) not in left_out][: limit - len(found)]
    return found


def look_today(
    backend: Backend,
    changed: Changes | None,
    since_ns: int | None = None,
    shelved: Shelf | None = None,
    together: AsOne | None = None,
) -> list[dict[str, Any]]:
    """The loops in which PV does not answer OP, those first of which that is news, without those that are shelved;
    since_ns: as of `worst`. Of loops that came to stand together the weightiest, with all of them in `together`."""
    told = as_one(backend, shelved, since_ns=since_ns) if together is None else together
    news = {row.loop for row in changed.rows} if changed else set()
    asked = replace(asked_today(since_ns), left_out=told.left_out)
    rows = not_shelved(backend, MOST_TODAY, asked, shelved)
    rows = [row | {"together": told.by_tag.get(row["loop"])} for row in rows]
    return sorted(rows, key=lambda row: news.isdisjoint(row["together"].loops if row["together"] else (row["loop"],)))


def asked_today(since_ns: int | None) -> RowFilter:
    """The loops in which PV does not answer OP; since_ns: as of `worst`."""
    return RowFilter(verdict=NO_ANSWER_VERDICTS, likely_cause=UNANSWERED, recorded_from_ns=since_ns)


def worst(
    backend: Backend,
    limit: int = WORST,
    beside: Collection[str] = (),
    since_ns: int | None = None,
    shelved: Shelf | None = None,
    together: AsOne = ALONE,
) -> list[dict[str, Any]]:
    """The judged loops at the head of the list by what is missing to full health x importance, those that stick
    reliably first, without those that are shelved; `beside`: tags of those that are listed elsewhere; since_ns: only
    loops with a sample as new as that."""
    asked = RowFilter(recorded_from_ns=since_ns, left_out=together.left_out)

    def listed(most: int, wanted: RowFilter) -> list[dict[str, Any]]:
        return not_shelved(backend, most, wanted, shelved)

    return _sticking_first(listed, asked, beside, limit, lambda row: str(row["loop"]))


def worst_of_old(
    backend: Backend,
    since_ns: int | None,
    limit: int = WORST,
    shelved: Shelf | None = None,
    together: AsOne = ALONE,
) -> list[dict[str, Any]]:
    """The same of the loops that are left out there: what is said of them is of an old record, or of one without a
    date."""
    if since_ns is None:
        return []
    asked = RowFilter(recorded_before_ns=since_ns, left_out=together.left_out)
    return [_marked_old(row) for row in not_shelved(backend, limit, asked, shelved)]


def complaints_of_units(
    backend: Backend, since_ns: int | None, shelved: Shelf, each: int, together: AsOne = ALONE
) -> list[tuple[str | None, list[dict[str, Any]]]]:
    """Of each unit the worst of the loops that stick, may, or show no answer of PV to OP; of loops that are told of as
    one the one that speaks for all."""
    left_out = (*shelved.left_out, *together.left_out)
    with backend.database.read() as connection:
        placed = plant.worst_of_units(connection, each, complaints=True, since_ns=since_ns, left_out=left_out)
    rows = _rows_of(backend, placed, shelved)
    return [(unit, list(some)) for unit, some in groupby(rows, lambda row: row["unit"])]


def complaints_of_old(
    backend: Backend, since_ns: int | None, shelved: Shelf, limit: int = WORST, together: AsOne = ALONE
) -> list[dict[str, Any]]:
    """The same of those of all units without a sample as new as that."""
    if since_ns is None:
        return []
    left_out = (*shelved.left_out, *together.left_out)
    with backend.database.read() as connection:
        placed = plant.worst_of_old(connection, limit, since_ns, left_out)
    return [_marked_old(row) for row in _rows_of(backend, placed, shelved, since_ns)]


def _marked_old(row: dict[str, Any]) -> dict[str, Any]:
    """How old a record without a date is, is not known: its row says there what it says in the table."""
    ends = row["recorded_to"]
    return row | {OLD: True} if ends and PlantClock.dated(ends) else row


def _rows_of(
    backend: Backend, placed: Sequence[Any], shelved: Shelf, before_ns: int | None = None
) -> list[dict[str, Any]]:
    """Rows of `table` of these loops, in their order; a loop that was audited or retired meanwhile may be missing.
    before_ns: all of them end before it."""
    tags = tuple(row.tag for row in placed)
    asked = RowFilter(tags=tags, recorded_before_ns=before_ns)
    rows = table(backend, len(tags), filters=asked, shelved=shelved).rows if tags else []
    by_tag = {row["loop"]: row for row in rows}
    return [by_tag[tag] for tag in tags if tag in by_tag]


def nothing_worst(sticking: int, old: bool) -> str:
    """What is said where no loop is listed as a worst one. sticking: how many verdicts say that the valve sticks; those
    are shelved, or of old records, which have a list of their own (`old`)."""
    if not sticking:
        return "No valve sticks, as far as the records tell."
    return f"No other valve sticks, as far as the {'newest ' if old else ''}records tell."


def not_shelved(
    backend: Backend, limit: int, asked: RowFilter, shelved: Shelf | None = None, notes_until: datetime | None = None
) -> list[dict[str, Any]]:
    """Rows of `table`, the weightiest first, without loops that are shelved; one that is worse than when it was shelved
    is among them, and says so (`shelved`)."""
    known = shelf(backend) if shelved is None else shelved
    wanted = replace(asked, left_out=(*known.left_out, *asked.left_out))
    return table(backend, limit, filters=wanted, shelved=known, notes_until=notes_until).rows
