"""The loops that are looked at first: those that want it today, and the worst of the others.

The worst are everywhere those that lack most to full health, times their importance. The page of the plant asks it of
all loops that were judged, because who sits before it mends tuning and transmitters too, and of those whose valves
stick reliably before the others. What could not be audited has a count of its own: that nothing is known of a valve is
no evidence against it. A report or a digest sends people to valves: they ask it of those loops alone that stick, may,
or show no answer of PV to OP, unit by unit, and say so.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby
from typing import Any, TypeVar

from app.engine.codes import NO_ANSWER_VERDICTS, UNANSWERED
from app.services.backend import Backend
from app.services.plant.changes import Changes
from app.services.plant.listing import Listing
from app.services.plant.reliability import table
from app.storage import plant, verdicts
from app.storage.asked_rows import Order, RowFilter
from app.storage.plant import TileRow

Loop = TypeVar("Loop")

JUDGED = ("stiction", "inconclusive", "no_stiction")
WORST = 12
MOST_TODAY = 200


def listed_first(
    backend: Backend, by: Listing, changed: Changes | None = None
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """What the plant's page lists at its head: the loops to look at today, and the worst of the others."""
    today = look_today(backend, by, changed)
    return today, worst(backend, by, beside={row["loop"] for row in today})


def worst_tags(backend: Backend, by: Listing) -> list[str]:
    """The tags of what `listed_first` lists as the worst, in its order, from the narrow rows alone."""
    order = Order("priority", descending=True)
    with backend.database.read() as connection:

        def first(limit: int, asked: RowFilter) -> list[str]:
            wanted = replace(asked, left_out=by.left_out)
            return [row.tag for row in verdicts.sent_rows(connection, limit, order, wanted, None)]

        today = set(first(MOST_TODAY, asked_today(by.since_ns)))
        return _sticking_first(first, RowFilter(recorded_from_ns=by.since_ns), today, WORST, lambda tag: tag)


def _sticking_first(
    first: Callable[[int, RowFilter], list[Loop]],
    asked: RowFilter,
    beside: Collection[str],
    limit: int,
    tag_of: Callable[[Loop], str],
) -> list[Loop]:
    """Those of the judged loops that stick reliably, then the others, each in its order."""
    judged = replace(asked, verdict=JUDGED)
    reliably = replace(judged, verdict=("stiction",), reliability="reliable")
    found = [one for one in first(limit + len(beside), reliably) if tag_of(one) not in beside][:limit]
    if len(found) < limit:
        left_out = {*beside, *map(tag_of, found)}
        others = first(limit + len(left_out), judged)
        found += [one for one in others if tag_of(one) not in left_out][: limit - len(found)]
    return found


def look_today(backend: Backend, by: Listing, changed: Changes | None = None) -> list[dict[str, Any]]:
    """The loops in which PV does not answer OP, those first of which that is news. Of loops that came to stand together
    the weightiest, with all of them in `together`."""
    news = {row.loop for row in changed.rows} if changed else set()
    rows = listed(backend, by, MOST_TODAY, asked_today(by.since_ns))
    rows = [row | {"together": by.together.by_tag.get(row["loop"])} for row in rows]
    return sorted(rows, key=lambda row: news.isdisjoint(row["together"].loops if row["together"] else (row["loop"],)))


def asked_today(since_ns: int | None) -> RowFilter:
    """The loops in which PV does not answer OP; since_ns: only those with a sample as new as that."""
    return RowFilter(verdict=NO_ANSWER_VERDICTS, likely_cause=UNANSWERED, recorded_from_ns=since_ns)


def worst(backend: Backend, by: Listing, limit: int = WORST, beside: Collection[str] = ()) -> list[dict[str, Any]]:
    """The judged loops at the head of the list by what is missing to full health x importance, those that stick
    reliably first; `beside`: tags of those that are listed elsewhere."""
    first, asked = partial(listed, backend, by), RowFilter(recorded_from_ns=by.since_ns)
    return _sticking_first(first, asked, beside, limit, lambda row: str(row["loop"]))


def worst_of_old(backend: Backend, by: Listing, limit: int = WORST) -> list[dict[str, Any]]:
    """The same of the loops that are left out there: what is said of them is of an old record, or of one without a
    date."""
    if by.since_ns is None:
        return []
    return listed(backend, by, limit, RowFilter(recorded_before_ns=by.since_ns))


def complaints_of_units(backend: Backend, by: Listing, each: int) -> list[tuple[str | None, list[dict[str, Any]]]]:
    """Of each unit the worst of the loops that stick, may, or show no answer of PV to OP; of loops that are told of as
    one the one that speaks for all."""
    with backend.database.read() as connection:
        placed = plant.worst_of_units(
            connection, each, complaints=True, since_ns=by.since_ns, left_out=by.left_out, audit_id=by.audit_id
        )
    rows = _rows_of(backend, placed, by, RowFilter())
    return [(unit, list(some)) for unit, some in groupby(rows, lambda row: row["unit"])]


def complaints_of_old(backend: Backend, by: Listing, limit: int = WORST) -> list[dict[str, Any]]:
    """The same of those of all units without a sample as new as that."""
    if by.since_ns is None:
        return []
    with backend.database.read() as connection:
        placed = plant.worst_of_old(connection, limit, by.since_ns, by.left_out, by.audit_id)
    return _rows_of(backend, placed, by, RowFilter(recorded_before_ns=by.since_ns))


def _rows_of(backend: Backend, placed: Sequence[TileRow], by: Listing, asked: RowFilter) -> list[dict[str, Any]]:
    """Rows of `table` of these loops, in their order; a loop that was audited or retired meanwhile may be missing."""
    tags = tuple(row.tag for row in placed)
    by_tag = {row["loop"]: row for row in listed(backend, by, len(tags), replace(asked, tags=tags))} if tags else {}
    return [by_tag[tag] for tag in tags if tag in by_tag]


def nothing_worst(sticking: int, old: bool) -> str:
    """What is said where no loop is listed as a worst one. sticking: how many verdicts say that the valve sticks; those
    are shelved, or of old records, which have a list of their own (`old`)."""
    if not sticking:
        return "No valve sticks, as far as the records tell."
    return f"No other valve sticks, as far as the {'newest ' if old else ''}records tell."


def listed(backend: Backend, by: Listing, limit: int, asked: RowFilter) -> list[dict[str, Any]]:
    """Rows of `table`, the weightiest first; one that is worse than when it was shelved says so (`shelved`)."""
    wanted = replace(asked, audit_id=by.audit_id, left_out=by.left_out)
    return table(backend, limit, filters=wanted, shelved=by.shelf, notes_until=by.notes_until).rows
