"""Tables with types, as parquet and workbooks have them. Their rows go the way that rows of text go."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray
from polars import selectors

from app.counting import counted
from app.errors import DataError
from app.ingest.columns.further_down import may_part_rows_below
from app.ingest.columns.plans import LongPlan, Plan, name_of
from app.ingest.files.head import HEAD_ROWS, TAIL_ROWS, Head, find_decimal_mark, with_rows
from app.ingest.files.opening import MOST_ROWS, SAMPLES
from app.ingest.layouts import not_recognised, recognise, recognise_again
from app.ingest.model import IngestOptions
from app.ingest.numbers.marks import POINTED, WRITTEN
from app.ingest.rejecting import RejectLog
from app.ingest.tables.frames import NUMBERED, Rows
from app.ingest.tables.scanning import Scanner

_LINE_END = re.compile("[\r\n]+")  # in a cell whose text is wrapped
CELLS_A_CHUNK = 2_000_000
CELLS_OF_HEAD = 200_000
FEWEST_COLUMNS, MOST_COLUMNS = 1000, 4000  # of a wide table at a time, by how long it is: 4000 have a day of minutes
CELLS_A_PASS = 6_000_000  # to look columns up costs as much, whether few or many are asked for


@dataclass(frozen=True, eq=False)
class Table:
    """A table in a file: `part(offset, count, columns)` are rows of it, of columns c0, c1, ... those with these
    numbers. apart: columns are read without the others; texts: then those of text. `notes`: what was odd about the
    file."""

    width: int
    height: int
    names: tuple[str, ...]
    part: Callable[[int, int, Sequence[int]], pl.DataFrame]
    apart: bool = False
    texts: frozenset[int] = frozenset()
    notes: tuple[str, ...] = ()

    @property
    def most_columns(self) -> int:
        """So many are taken at a time where they are read apart."""
        return min(MOST_COLUMNS, max(FEWEST_COLUMNS, CELLS_A_PASS // max(1, self.height)))


class TableReader:
    """Gives a table's columns in the types asked for."""

    def __init__(self, table: Table, types: dict[int, pl.DataType], names_in_rows: bool) -> None:
        self._table, self._types, self._names_in_rows = table, types, names_in_rows
        self._original = pl.DataFrame()

    @property
    def most_columns(self) -> int | None:
        return self._table.most_columns if self._table.apart else None

    def of_text(self, columns: Sequence[int]) -> frozenset[int]:
        return self._table.texts.intersection(columns)

    def rows(self, first_row: int, columns: Sequence[int] | None = None) -> Iterator[Rows]:
        """All rows from the given one (counted from 0, names included) on."""
        wanted = sorted(self._types if columns is None else self._types.keys() & set(columns))
        start = first_row if self._names_in_rows else max(first_row - 1, 0)
        count = max(1000, CELLS_A_CHUNK // max(1, len(wanted)))
        for offset in range(start, self._table.height, count):
            self._original = self._table.part(offset, count, wanted)
            kinds = self._original.schema
            odd = [i for i in wanted if kinds[name_of(i)] != self._types[i]]
            frame = self._original.with_columns(_as(self._original[name_of(i)], self._types[i]) for i in odd)
            yield Rows(frame, offset + 1, b"")

    def scanning(self, plan: LongPlan) -> Scanner | None:
        return None

    def parted(self, rows: Rows) -> Rows:
        return rows

    def texts(self, rows: Rows, columns: Sequence[int]) -> pl.DataFrame:
        """Columns of the rows read last as text."""
        wanted = (self._original[name_of(index)] for index in sorted(columns))
        return pl.DataFrame([_as(column, pl.String()).cast(pl.String) for column in wanted])

    def short_rows(self, rows: Rows, candidates: NDArray[np.int64]) -> NDArray[np.int64]:
        """None: a table has no ragged rows."""
        return candidates[:0]


class TableSource:
    """A file with a table whose layout is known."""

    damage: tuple[str, ...] = ()  # a damaged one is refused whole
    share_taken = 1.0

    def __init__(self, table: Table, stem: str, kind: str, names_in_rows: bool, options: IngestOptions) -> None:
        self._table, self._names_in_rows, self._options = table, names_in_rows, options
        self.encoding = kind
        self.compressed = False
        self.notes = list(table.notes)
        self._take(_head(table, stem, names_in_rows))

    def _take(self, head: Head) -> None:
        plan = recognise(head, self._options)
        if plan is not None and may_part_rows_below(plan, head):
            every = partial(_fields, self._table)
            plan = recognise_again(plan, with_rows(head, _sampled(self._table)), self._options, every)
        if plan is None:
            raise not_recognised(head)
        self.head: Head = head
        self.plan: Plan = plan

    def call(self, stem: str) -> None:
        """Names the loop of a table that does not tell it."""
        self._take(replace(self.head, stem=stem))

    def tags(self) -> list[str]:
        """All that it has, of a long table those of all rows."""
        if not isinstance(self.plan, LongPlan):
            return [column.tag for timed in self.plan.groups for column in timed.values]
        cells = self._table.part(self.plan.first_row, self._table.height, [self.plan.tag]).to_series()
        return self.plan.tags_of(str(tag) for tag in cells.drop_nulls().unique(maintain_order=True))

    def reader(self, width: int, types: dict[int, pl.DataType], log: RejectLog) -> TableReader:
        width = self._table.width
        known = {index: pl.String() if kind is NUMBERED else kind for index, kind in types.items() if index < width}
        return TableReader(self._table, known, self._names_in_rows)


def open_parquet(path: Path, stem: str, options: IngestOptions) -> TableSource | None:
    """The file as a table, or None where it is no parquet."""
    with path.open("rb") as stream:
        return (
            TableSource(_parquet(path, options), stem, "parquet", False, options) if stream.read(4) == b"PAR1" else None
        )


def _parquet(path: Path, options: IngestOptions) -> Table:
    scan = pl.scan_parquet(path, hive_partitioning=False, glob=False)
    schema = scan.collect_schema()
    names = tuple(schema.names())
    height = int(scan.select(pl.len()).collect().item())
    if height * max(1, len(names)) * 8 > options.max_bytes:
        raise DataError(
            "decompressed_too_large", f"the table has {height:,} rows of {len(names):,} columns; send it in parts"
        )

    columns_of = [as_text_of_words(name, kind) for name, kind in schema.items()]

    def part(offset: int, count: int, columns: Sequence[int]) -> pl.DataFrame:
        return scan.slice(offset, count).select(columns_of[i].alias(name_of(i)) for i in columns).collect()

    closed = [name for name, kind in schema.items() if _holds_no_values(kind)]
    shown = ", ".join(name[:80] for name in closed[:5])
    hold = counted(len(closed), "column holds", "columns hold")
    notes = (f"{hold} lists, structures or bytes, which are no values: {shown}",) if closed else ()
    texts = frozenset(index for index, kind in enumerate(schema.values()) if kind == pl.String or _is_of_words(kind))
    return Table(len(names), height, names, part, apart=True, texts=texts, notes=notes)


def as_text_of_words(name: str, kind: pl.DataType) -> pl.Expr:
    """A column, of a dictionary of words the words: whether their numbers are kept apart is a matter of packing."""
    return pl.col(name).cast(pl.String) if _is_of_words(kind) else pl.col(name)


def _is_of_words(kind: pl.DataType) -> bool:
    return isinstance(kind, pl.Categorical | pl.Enum)


def _holds_no_values(kind: pl.DataType) -> bool:
    return kind.is_nested() or kind == pl.Binary


def in_seconds(durations: pl.Series) -> pl.Series:
    return durations.dt.total_microseconds() / 1e6


def _as(column: pl.Series, wanted: pl.DataType) -> pl.Series:
    """A column in the type wanted; times stay times, and lists or bytes are no values."""
    if column.dtype == wanted or (wanted == pl.String and isinstance(column.dtype, pl.Datetime)):
        return column
    if _holds_no_values(column.dtype):
        return pl.Series(column.name, [None] * len(column), dtype=wanted)
    if isinstance(column.dtype, pl.Duration):
        return _as(in_seconds(column), wanted)
    if isinstance(wanted, pl.Categorical):
        return column.cast(pl.String, strict=False).cast(wanted)
    if column.dtype == pl.String and wanted == pl.Float64 and column.str.contains(WRITTEN).any():
        column = column.set(column.str.contains(POINTED).fill_null(False), None)
    return column.cast(wanted, strict=False)


def _head(table: Table, stem: str, names_in_rows: bool) -> Head:
    rows = _rows(table, 0, max(8, min(HEAD_ROWS, CELLS_OF_HEAD // max(1, table.width))))
    rows = rows if names_in_rows else (table.names, *rows)
    lines = tuple("\t".join(row) for row in rows)
    return Head(stem, lines, rows, "", find_decimal_mark(rows, "\t"), True, int(names_in_rows))


def _sampled(table: Table) -> tuple[tuple[str, ...], ...]:
    """Rows from all over the table, behind its first ones."""
    each = TAIL_ROWS // SAMPLES
    places = range(HEAD_ROWS, table.height, max(each, (table.height - HEAD_ROWS) // SAMPLES))
    if table.width * each * len(places) > CELLS_OF_HEAD:
        return ()
    return tuple(row for place in places for row in _rows(table, place, each))


def _fields(table: Table, columns: Sequence[int]) -> list[tuple[str, ...]]:
    """Those of some columns in all rows; none where there are too many rows."""
    if table.height > MOST_ROWS:
        return []
    frame = table.part(0, table.height, columns)
    return list(zip(*(_as_text(frame[name_of(at)]).fill_null("").to_list() for at in columns), strict=True))


def _rows(table: Table, offset: int, count: int) -> tuple[tuple[str, ...], ...]:
    """As text. Of a long table the columns are read in parts: each that is asked for takes memory."""
    most = table.most_columns
    parts = (range(start, min(start + most, table.width)) for start in range(0, table.width, most))
    texts = [column for part in parts for column in _texts(table.part(offset, count, part)).get_columns()]
    return tuple(pl.DataFrame(texts).rows())


def _texts(frame: pl.DataFrame) -> pl.DataFrame:
    """All cells as text in one line, empty where there is none; numbers, which wide tables hold, all at once."""
    others = frame.select(~selectors.numeric()).get_columns()
    lines = [pl.Series(column.name, map(_in_one_line, _as_text(column).fill_null("")), pl.String) for column in others]
    numbers = selectors.numeric().cast(pl.String, strict=False).fill_null("")
    return frame.with_columns(numbers).with_columns(lines)


def _in_one_line(text: str) -> str:
    return _LINE_END.sub(" ", text).strip()


def _as_text(column: pl.Series) -> pl.Series:
    if isinstance(column.dtype, pl.Datetime):
        zoned = column.dtype.time_zone is not None
        plain = column.dt.convert_time_zone("UTC").dt.replace_time_zone(None) if zoned else column
        return plain.dt.strftime("%Y-%m-%d %H:%M:%S%.6f" + ("Z" if zoned else ""))
    return _as(column, pl.String())
