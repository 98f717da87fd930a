"""The per-loop reliability table: a page of rows, as they are or as JSON."""

import hashlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from app.errors import RequestError
from app.json_texts import read_json
from app.services.audit_json.rows import FORM, OLD, as_row, compact, sampled
from app.services.backend import Backend
from app.services.cursors import decode, encode, page_of, refused
from app.services.moments import PlantClock, iso_utc
from app.services.plant.told_until import notes_until
from app.services.plant.written import marks_of, written_of
from app.services.results import Page
from app.services.stating.shelving import Shelf, shelf
from app.storage import verdicts
from app.storage.asked_rows import SORTABLE, After, RowFilter, comparable
from app.storage.verdicts import SentRow, Settled, ToldRow

MOST_ROWS = 20_000
PART_ROWS = 500
OF_LOOP = ("type", "description", "owner", "importance", "priority", "recorded_to")  # of the loop, not of its verdict
THE_SAME = {"audited_at_ms": "audited_at", "window_start_ms": "window_start", "window_end_ms": "window_end"}
ANYTHING: tuple[type, ...] = (object,)

__all__ = ["RowFilter", "in_parts", "reliability_json", "sortable", "table"]


def sortable() -> tuple[str, ...]:
    """Names to sort by; a minus before one turns the order round."""
    return tuple(sorted({*SORTABLE, *THE_SAME}))


def table(
    backend: Backend,
    limit: int,
    cursor: str | None = None,
    sort: str = "-priority",
    filters: RowFilter | None = None,
    shelved: Shelf | None = None,
    notes_until: datetime | None = None,
) -> Page[dict[str, Any]]:
    """A page of rows for people, with what it shows besides the newest verdicts: importance and priority, what to do as
    a `Step`, and what is written of an order or a repair (until `notes_until`) or a shelving (as of `shelved`; None:
    both as the API tells them). Rows that are asked for because their records end before a time are of old ones by now,
    whatever their runs knew. Whoever chose another order with a cursor in the address begins at its head."""
    name, after = _checked(limit, sort), _after(cursor, sort, any_order=True)
    with backend.database.read() as connection:
        rows = verdicts.table(connection, limit + 1, name, sort.startswith("-"), filters or RowFilter(), after)
    found = page_of(rows, limit, lambda row: row, lambda row: (sort, row["sorted_by"], row["tag"]))
    shown = [with_loop(row, filters) for row in found.rows]
    if shelved is None:
        shelved, notes_until = _written_by(backend, filters)
    if filters is not None and filters.recorded_before_ns is not None:
        shown = [row | {OLD: row[OLD] or PlantClock.dated(row["recorded_to"])} for row in shown]
    written = written_of(backend, shown, shelved, notes_until)
    beside = [{"step": written.step(row), "shelved": written.shelved_words(row)} for row in shown]
    return Page([{**written.beside(row), **more} for row, more in zip(shown, beside, strict=True)], found.next_cursor)


def count(backend: Backend, filters: RowFilter) -> int:
    """How many rows of the table fit."""
    with backend.database.read() as connection:
        return verdicts.count(connection, filters)


@dataclass(frozen=True)
class PagePlace:
    """Where a page stands among the rows that fit: `behind` so many, `of` so many in all. previous_cursor: of the page
    before, None where that one is the head of the table."""

    behind: int
    of: int
    previous_cursor: str | None


def page_place(backend: Backend, limit: int, cursor: str | None, sort: str, filters: RowFilter) -> PagePlace:
    """Of the page that `table` gives for the same. Counted anew, because rows come, go and change places between two
    looks; the page before ends where this one begins."""
    name, descending, after = _checked(limit, sort), sort.startswith("-"), _after(cursor, sort, any_order=True)
    with backend.database.read() as connection:
        counted = verdicts.count(connection, filters)
        if after is None:
            return PagePlace(0, counted, None)
        behind = max(counted - verdicts.count_beyond(connection, name, descending, filters, after), 0)
        last = None
        if behind > limit:
            last = verdicts.row_at(connection, name, descending, filters, behind - limit - 1)
    return PagePlace(behind, counted, None if last is None else encode(sort, last.value, last.tag))


def _written_by(backend: Backend, filters: RowFilter | None) -> tuple[Shelf, datetime | None]:
    """What is shelved, and up to when notes count, for the rows that are asked for."""
    until = _until(backend, filters)
    return _shelf(backend, filters, until), until


def _shelf(backend: Backend, filters: RowFilter | None, until: datetime | None) -> Shelf:
    return shelf(backend) if filters is None or until is None else shelf(backend, filters.audit_id, until)


def _until(backend: Backend, filters: RowFilter | None) -> datetime | None:
    """Up to when notes count: of the newest verdicts up to now (None)."""
    if filters is None or filters.audit_id is None:
        return None
    with backend.database.read() as connection:
        return notes_until(connection, filters.audit_id)


def with_loop(stored: dict[str, Any], filters: RowFilter | None = None) -> dict[str, Any]:
    """A stored verdict as a row, with what its loop is now. recorded_to: of a run that is asked for what it was given,
    as `RowFilter` goes by."""
    newest = "newest_ns" if filters is None or filters.audit_id is None else "input_end_ns"
    return as_row(stored) | {name: stored[name] for name in OF_LOOP[:-1]} | {"recorded_to": sampled(stored[newest])}


@dataclass(frozen=True)
class TableParts:
    """A page of the table whose rows are read when they are asked for, `PART_ROWS` at a time: whole, those of a plant
    would have 200 MB. `version` changes with what they say, `count` is how many there are. A row whose verdict has been
    dropped meanwhile is left out."""

    version: str
    count: int
    next_cursor: str | None
    parts: Callable[[], Iterator[list[dict[str, Any]]]]


def in_parts(
    backend: Backend,
    limit: int = 1000,
    cursor: str | None = None,
    sort: str = "loop",
    filters: RowFilter | None = None,
    of_loop: bool = True,
) -> TableParts:
    """One row a loop, its newest verdict. `sort`: a name of `sortable()`, `-name` for descending; unknowns last.

    of_loop: with the loop's type, importance and priority, and its newest sample. Rows of newest verdicts without these
    are read as they were written when their verdicts were made, in a fraction of the time."""
    name, after = _checked(limit, sort), _after(cursor, sort)
    with backend.database.read() as connection:
        rows = verdicts.told_rows(connection, limit + 1, name, sort.startswith("-"), filters or RowFilter(), after)
        settled = verdicts.settled(connection, {row.audit_id for row in rows})
    page = page_of(rows, limit, lambda row: row, lambda row: (sort, row.value, row.tag))
    shown, marks = page.rows, marks_of(backend, [row.tag for row in page.rows])
    until = _until(backend, filters)
    of_loops = [tuple(row._replace(value=None)) for row in shown]
    said = [FORM, page.next_cursor, _told(settled), of_loops, marks.told, iso_utc(until)]

    def parts() -> Iterator[list[dict[str, Any]]]:
        """Nothing of a part is held here once it is given."""
        known = _shelf(backend, filters, until)
        of_run = filters is not None and filters.audit_id is not None
        stored = None if of_loop or of_run else _Stored(settled, marks.tags)
        some = (shown[at : at + PART_ROWS] for at in range(0, len(shown), PART_ROWS))
        return (_part(backend, rows, filters, known, until, stored) for rows in some)

    return TableParts(_digest(compact(said).encode()), len(shown), page.next_cursor, parts)


@dataclass(frozen=True)
class _Stored:
    """By what rows are known to be as they were written: their runs, and the tags of which more is written since."""

    settled: Mapping[int, Settled]
    marked: Collection[str]


def _part(
    backend: Backend,
    rows: Sequence[ToldRow],
    filters: RowFilter | None,
    known: Shelf,
    until: datetime | None,
    stored_rows: _Stored | None,
) -> list[dict[str, Any]]:
    if stored_rows is not None:
        return _as_stored(backend, rows, stored_rows, known)
    with backend.database.read() as connection:
        stored = verdicts.of_keys(connection, [row.key for row in rows])
    told = [with_loop(stored[row.key], filters) for row in rows if row.key in stored]
    written = written_of(backend, told, known, until)
    return [written.beside(row) for row in told]


def _as_stored(backend: Backend, rows: Sequence[ToldRow], by: _Stored, known: Shelf) -> list[dict[str, Any]]:
    """The same of newest verdicts, without what is of their loops. One that a newer verdict has followed since the page
    was looked up is read from its columns, as is one without a row of this version."""
    with backend.database.read() as connection:
        texts = backend.row_texts.of(connection, rows, by.settled, FORM)
        read = {row.key: _read(texts[row.loop_id], row.unit) for row in rows if row.loop_id in texts}
        told = {key: row for key, row in read.items() if row["audit_id"] == str(key[1])}
        others = verdicts.of_keys(connection, [row.key for row in rows if row.key not in told])
    anew = {key: as_row(stored) for key, stored in others.items()}
    anew |= {row.key: told[row.key] for row in rows if row.tag in by.marked and row.key in told}
    if anew:
        written = written_of(backend, list(anew.values()), known)
        told |= {key: written.beside(row) for key, row in anew.items()}
    return [told[row.key] for row in rows if row.key in told]


@dataclass(frozen=True)
class TableAnswer:
    """A page of the table as JSON, `{"rows": [...], "next_cursor": ...}`. `version` changes with what it says, and is
    known before the page is written."""

    version: str
    write: Callable[[], bytes]


def reliability_json(
    backend: Backend,
    limit: int = 1000,
    cursor: str | None = None,
    sort: str = "loop",
    filters: RowFilter | None = None,
) -> TableAnswer:
    """The page of the newest verdicts, with each row as it was written when its verdict was made."""
    filters = filters or RowFilter()
    name = _checked(limit, sort)
    with backend.database.read() as connection:
        after = _after(cursor, sort)
        rows = verdicts.sent_rows(connection, limit + 1, name, sort.startswith("-"), filters, after)
        settled = verdicts.settled(connection, {row.audit_id for row in rows})
    sent_page = page_of(rows, limit, lambda row: row, lambda row: (sort, row.value, row.tag))
    shown, behind = sent_page.rows, sent_page.next_cursor
    marks = marks_of(backend, [row.tag for row in shown])
    said = [FORM, behind, _told(settled), [(row.loop_id, row.audit_id, row.unit) for row in shown], marks.told]
    return TableAnswer(_digest(compact(said).encode()), lambda: _written(backend, shown, settled, behind, marks.tags))


def _told(settled: Mapping[int, Settled]) -> dict[str, list[str]]:
    return {str(number): list(map(str, times)) for number, times in sorted(settled.items())}


def _digest(said: bytes) -> str:
    return hashlib.sha256(said).hexdigest()[:32]


def _checked(limit: int, sort: str) -> str:
    """The name to sort by, of an order that there is."""
    if not 1 <= limit <= MOST_ROWS:
        raise RequestError("bad_limit", f"limit must be from 1 to {MOST_ROWS:,}, got {limit:,}")
    name = sort.removeprefix("-")
    name = THE_SAME.get(name, name)
    if name not in SORTABLE:
        raise RequestError("bad_sort", f"cannot sort by {name!r}; there is {', '.join(sortable())}")
    return name


def _written(
    backend: Backend,
    rows: Sequence[SentRow],
    settled: Mapping[int, Settled],
    next_cursor: str | None,
    marked: Collection[str],
) -> bytes:
    """Each row's JSON as stored, else made from its columns; none where its verdict has been dropped meanwhile.

    marked: tags of loops of which something is written that no stored row tells; few, so that these are made anew.
    """
    with backend.database.read() as connection:
        texts = backend.row_texts.of(connection, rows, settled, FORM)
        unwritten = [row.loop_id for row in rows if row.loop_id not in texts]
        stored = verdicts.newest_of(connection, unwritten) if unwritten else {}
    told = {tag: as_row(row) for tag, row in stored.items()}
    told |= {
        row.tag: _read(texts.pop(row.loop_id), row.unit) for row in rows if row.tag in marked and row.loop_id in texts
    }
    written = written_of(backend, list(told.values())) if told else None
    units = {unit: f',"unit":{compact(unit)}}}'.encode() for unit in {row.unit for row in rows}}
    pieces: list[bytes] = []  # put together once: 40 MB are not copied row by row before
    for row in rows:
        text = texts.get(row.loop_id)
        if text is not None:
            pieces += (b",{", text, units[row.unit])
        elif written is not None and row.tag in told:
            pieces += (b",", compact(written.beside(told[row.tag])).encode())
    pieces[:1] = [piece.removeprefix(b",") for piece in pieces[:1]]
    return b"".join((b'{"rows":[', *pieces, *_ending(next_cursor)))


def _read(text: bytes, unit: str | None) -> dict[str, Any]:
    """A row that is stored as JSON."""
    return {**read_json(b"{" + text + b"}"), "unit": unit}


def _ending(next_cursor: str | None) -> tuple[bytes, ...]:
    return b'],"next_cursor":', compact(next_cursor).encode(), b"}"


def _place_of(cursor: str | None) -> tuple[str, After] | None:
    """The order that a cursor belongs to and the row that it stands behind. Raises RequestError("bad_cursor")."""
    values = decode(cursor, (str, ANYTHING, str))
    if cursor is None or values is None:
        return None
    sort, value, tag = values
    name = sort.removeprefix("-")
    if not comparable(THE_SAME.get(name, name), value):
        raise refused(cursor)
    return sort, After(value, tag)


def _after(cursor: str | None, sort: str, *, any_order: bool = False) -> After | None:
    place = _place_of(cursor)
    if place is None or (any_order and place[0] != sort):
        return None
    if place[0] != sort:
        raise RequestError("bad_cursor", f"this cursor belongs to sort={place[0]!r}, not to sort={sort!r}")
    return place[1]
