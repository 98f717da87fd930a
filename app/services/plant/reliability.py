"""The per-loop reliability table: a page of rows, for people or as others read it."""

import hashlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property, partial
from itertools import chain
from typing import Any

from sqlalchemy import Connection

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
from app.storage.asked_rows import SORTABLE, After, Order, RowFilter, comparable
from app.storage.verdicts import SentRow, Settled

MOST_ROWS = 20_000
PART_ROWS = 500
OF_LOOP = ("type", "description", "owner", "importance", "priority", "recorded_to")  # of the loop, not of its verdict
THE_SAME = {"audited_at_ms": "audited_at", "window_start_ms": "window_start", "window_end_ms": "window_end"}
ANYTHING: tuple[type, ...] = (object,)

__all__ = ["RowFilter", "in_parts", "sortable", "table"]


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
    order, after = _checked(limit, sort), _after(cursor, sort, any_order=True)
    with backend.database.read() as connection:
        rows = verdicts.table(connection, limit + 1, order, filters or RowFilter(), after)
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
    order, after = _checked(limit, sort), _after(cursor, sort, any_order=True)
    with backend.database.read() as connection:
        counted = verdicts.count(connection, filters)
        if after is None:
            return PagePlace(0, counted, None)
        behind = max(counted - verdicts.count_beyond(connection, order, filters, after), 0)
        last = None
        if behind > limit:
            last = verdicts.row_at(connection, order, filters, behind - limit - 1)
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
class Part:
    """Rows of a page, in its order. stored: of those that are sent as they were written when their verdicts were made,
    the inside of a JSON object, by the key of the loop; made: the others. Of neither: its verdict has been dropped
    meanwhile, and it is left out."""

    asked: Sequence[SentRow]
    stored: Mapping[int, bytes]
    made: Mapping[int, dict[str, Any]]

    @property
    def rows(self) -> Iterator[dict[str, Any]]:
        for row in self.asked:
            if (text := self.stored.get(row.loop_id)) is not None:
                yield _fields(text, row.unit)
            elif row.loop_id in self.made:
                yield self.made[row.loop_id]

    def as_json(self) -> list[bytes]:
        """In pieces, with a comma before each row."""
        units = {unit: f',"unit":{compact(unit)}}}'.encode() for unit in {row.unit for row in self.asked}}
        pieces: list[bytes] = []
        for row in self.asked:
            if (text := self.stored.get(row.loop_id)) is not None:
                pieces += (b",{", text, units[row.unit])
            elif row.loop_id in self.made:
                pieces += (b",", compact(self.made[row.loop_id]).encode())
        return pieces

    def as_json_of(self, columns: Sequence[str]) -> list[bytes]:
        """The same of these fields alone, in this order."""
        return [b"," + compact({name: row[name] for name in columns}).encode() for row in self.rows]


def _fields(text: bytes, unit: str | None) -> dict[str, Any]:
    """A row that is stored as JSON."""
    return {**read_json(b"{" + text + b"}"), "unit": unit}


@dataclass(frozen=True)
class Reading:
    """How the rows of a page are read. settled: when their runs were begun and ended; marked: the tags of loops of
    which something is written that no stored row tells; until: up to when notes count."""

    backend: Backend
    filters: RowFilter
    of_loop: bool
    settled: Mapping[int, Settled]
    marked: Collection[str]
    until: datetime | None

    def part(self, asked: Sequence[SentRow]) -> Part:
        """As they are stored; made of their columns where a row is asked for otherwise, is of another form, or has been
        followed by a newer verdict. Few are marked, so that these are put together anew."""
        with self.backend.database.read() as connection:
            texts = self._texts(connection, asked)
            others = verdicts.of_keys(connection, [row.key for row in asked if row.loop_id not in texts])
        of_columns = partial(with_loop, filters=self.filters) if self.of_loop else as_row
        made = {loop_id: of_columns(stored) for (loop_id, _), stored in others.items()}
        made |= {
            row.loop_id: _fields(texts.pop(row.loop_id), row.unit)
            for row in asked
            if row.tag in self.marked and row.loop_id in texts
        }
        if made:
            written = written_of(self.backend, list(made.values()), self._shelf, self.until)
            made = {loop_id: written.beside(row) for loop_id, row in made.items()}
        return Part(asked, texts, made)

    def _texts(self, connection: Connection, asked: Sequence[SentRow]) -> dict[int, bytes]:
        if self.of_loop or self.filters.audit_id is not None:
            return {}
        return self.backend.row_texts.of(connection, asked, self.settled, FORM)

    @cached_property
    def _shelf(self) -> Shelf:
        return _shelf(self.backend, self.filters, self.until)


@dataclass(frozen=True)
class TableParts:
    """A page of the table whose rows are read when they are asked for, so many at a time: all fields of those of a
    plant would have 200 MB. `version` changes with what they say."""

    version: str
    next_cursor: str | None
    asked: Sequence[SentRow]
    reading: Reading

    def parts(self, size: int | None = None) -> Iterator[Part]:
        """So many rows each (None: `PART_ROWS`). Nothing of a part is held here once it is given."""
        size = size or PART_ROWS
        return (self.reading.part(self.asked[at : at + size]) for at in range(0, len(self.asked), size))

    def json_parts(self, columns: Sequence[str] | None = None) -> Iterator[bytes]:
        """As JSON, `{"rows": [...], "next_cursor": ...}`. columns: of each row these alone, in this order; None: all
        that it has."""
        written = (part.as_json() if columns is None else part.as_json_of(columns) for part in self.parts())
        return map(b"".join, self._json(written))

    def as_json(self) -> bytes:
        """The same at once, of rows as they are stored: put together once, for 40 MB are not copied row by row
        before."""
        return b"".join(chain.from_iterable(self._json(part.as_json() for part in self.parts(len(self.asked)))))

    def _json(self, written: Iterable[list[bytes]]) -> Iterator[list[bytes]]:
        """What is before, between and behind the pieces of the parts."""
        head = b'{"rows":['
        for pieces in written:
            if head and pieces:
                pieces[0], head = head + pieces[0].removeprefix(b","), b""
            yield pieces
        yield [head, b'],"next_cursor":', compact(self.next_cursor).encode(), b"}"]


def in_parts(
    backend: Backend,
    limit: int = 1000,
    cursor: str | None = None,
    sort: str = "loop",
    filters: RowFilter | None = None,
    of_loop: bool = False,
) -> TableParts:
    """One row a loop, its newest verdict or that of a run. `sort`: a name of `sortable()`, `-name` for descending;
    unknowns last.

    of_loop: with the loop's type, importance and priority, and its newest sample. Rows of newest verdicts without these
    are read as they were written when their verdicts were made, in a fraction of the time."""
    filters = filters or RowFilter()
    order, after = _checked(limit, sort), _after(cursor, sort)
    with backend.database.read() as connection:
        rows = verdicts.sent_rows(connection, limit + 1, order, filters, after, of_loop)
        settled = verdicts.settled(connection, {row.audit_id for row in rows})
    page = page_of(rows, limit, lambda row: row, lambda row: (sort, row.value, row.tag))
    marks, until = marks_of(backend, [row.tag for row in page.rows]), _until(backend, filters)
    shown = [(row.loop_id, row.audit_id, row.unit, *row.of_loop) for row in page.rows]
    told = {str(number): list(map(str, times)) for number, times in sorted(settled.items())}
    said = [FORM, page.next_cursor, told, shown, marks.told, iso_utc(until)]
    version = hashlib.sha256(compact(said).encode()).hexdigest()[:32]
    reading = Reading(backend, filters, of_loop, settled, marks.tags, until)
    return TableParts(version, page.next_cursor, page.rows, reading)


def _checked(limit: int, sort: str) -> Order:
    """Of an order that there is."""
    if not 1 <= limit <= MOST_ROWS:
        raise RequestError("bad_limit", f"limit must be from 1 to {MOST_ROWS:,}, got {limit:,}")
    order = _order(sort)
    if order.name not in SORTABLE:
        raise RequestError("bad_sort", f"cannot sort by {order.name!r}; there is {', '.join(sortable())}")
    return order


def _order(sort: str) -> Order:
    """By the column that is sorted by, where it goes by another name too."""
    asked = Order.parsed(sort)
    return replace(asked, name=THE_SAME.get(asked.name, asked.name))


def _place_of(cursor: str | None) -> tuple[str, After] | None:
    """The order that a cursor belongs to and the row that it stands behind. Raises RequestError("bad_cursor")."""
    values = decode(cursor, (str, ANYTHING, str))
    if cursor is None or values is None:
        return None
    sort, value, tag = values
    if not comparable(_order(sort).name, value):
        raise refused(cursor)
    return sort, After(value, tag)


def _after(cursor: str | None, sort: str, *, any_order: bool = False) -> After | None:
    place = _place_of(cursor)
    if place is None or (any_order and place[0] != sort):
        return None
    if place[0] != sort:
        raise RequestError("bad_cursor", f"this cursor belongs to sort={place[0]!r}, not to sort={sort!r}")
    return place[1]
