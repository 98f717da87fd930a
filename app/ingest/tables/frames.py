"""Chunks of lines to frames of columns: polars' fast reader first; a chunk with odd rows is cleaned line by line and
read again."""

import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Protocol

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.plans import LongPlan, name_of
from app.ingest.files.ahead import ahead, side_by_side
from app.ingest.files.head import split_line
from app.ingest.files.opening import Lines, TextFile
from app.ingest.numbers.kinds import IN_DOUBT, WITH, kinds_of
from app.ingest.numbers.marks import has_points, marked, pointed
from app.ingest.rejecting import RejectLog
from app.ingest.tables.blank_lines import parts_between, with_empty_lines
from app.ingest.tables.line_widths import Uneven, uneven_lines
from app.ingest.tables.scanning import Scan, Scanner

LEAST_BYTES = 4 << 20  # of a chunk; for less it takes longer to load what is compiled
BLOCK_COLUMNS = 200  # from so many on, numbers are read side by side: a column costs more than its numbers
MOST_FIRST = 8  # columns of text within so many first ones are parted by themselves in such a table
MANY_LINES = 1 << 14  # from so many on, all delimiters are looked for at once
TOO_NARROW = "^#{3,}$"  # what spreadsheets show of a time that is wider than its column, and no comment
FIELD, BETWEEN_FIELDS = "v", "\x1f"
NO_ROW = (b"", b"*", b"#", b"[")  # how a line begins that holds nothing or a comment
NUMBERED = pl.Categorical()  # text that repeats: a number a text, by themselves in each chunk

# polars says so of odd quotes on the standard error of whoever reads; such a chunk is read again line by line, and told
warnings.filterwarnings("ignore", "CSV malformed", UserWarning)


@dataclass(frozen=True)
class Dialect:
    """How fields stand in a line, and how many."""

    delimiter: str
    decimal_mark: str
    width: int
    marks_told: bool = True  # else numbers with any mark are left to who knows their tags
    ends: frozenset[int] = frozenset()  # after so many fields a line may end as well

    @property
    def decimal_comma(self) -> bool:
        return self.decimal_mark == "," and self.marks_told

    @property
    def marks_doubtful(self) -> bool:
        """Whether any mark may part thousands."""
        return not self.marks_told and self.delimiter != ","

    @property
    def points_doubtful(self) -> bool:
        """Whether a point may part thousands: beside decimal commas alone where those are told or part the fields."""
        return self.decimal_mark == "," if self.marks_told else self.delimiter != ","


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a file. Row i of `frame` is line `first + i`; a line that could not be split is a row of nulls. `data`
    is the text. Of a table of many columns the numbers are in `block` (rows, width), not in `frame`; of plain rows of a
    long table all is in `scan`. `pointed`: by column, where numbers that were read have a point that may part
    thousands. `kinds` (width,), where marks are in doubt: of each column's fields; then all numbers were read as if
    marks stood before decimals, and none is in `pointed`. `fewer`: the rows of too few fields, where these were
    counted because not all columns are in `frame`. `blank`: how many of them are blank lines."""

    frame: pl.DataFrame
    first: int
    data: bytes
    faults: tuple[tuple[str, str, int], ...] = ()  # code, text and line of each line that could not be split
    block: "Numbers | None" = None
    scan: Scan | None = None  # then `frame` holds nothing
    pointed: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    kinds: NDArray[np.uint8] | None = None
    fewer: NDArray[np.int64] | None = None
    blank: int = 0

    @property
    def height(self) -> int:
        return self.frame.height if self.scan is None else len(self.scan.codes)

    @property
    def filled(self) -> int:
        """How many rows there are but for blank lines."""
        return self.height - self.blank

    def lines(self, rows: NDArray[np.int64]) -> list[int]:
        return (rows + self.first).tolist()

    def numbers(self, columns: Sequence[int]) -> "Numbers":
        """Columns of numbers, to be written to."""
        found = self._parsed(columns) if self.block is None else self.block.of(columns)
        for position, index in enumerate(columns) if self.pointed else ():
            if (at := self.pointed.get(name_of(index))) is not None:
                found.missing[:, position] |= at
        return found

    def doubtful(self, column: int, texts: pl.Series) -> NDArray[np.bool_]:
        """Where the marks of a column's numbers that were read are in doubt."""
        in_doubt = self.kinds is not None and bool(self.kinds[column] & IN_DOUBT)
        return marked(texts) if in_doubt else np.zeros(len(texts), dtype=bool)

    def may_be_short(self) -> NDArray[np.int64]:
        """Rows that may have too few fields, as comments and empty lines have."""
        if self.fewer is not None:
            return self.fewer
        return np.flatnonzero(self.frame[self.frame.columns[-1]].is_null().to_numpy())

    def hold_something(self, rows: NDArray[np.int64], columns: Sequence[int]) -> NDArray[np.bool_]:
        """Whether something was read in any of the columns of some rows."""
        if self.block is not None:
            numbers = self.block.of(columns)
            return np.asarray(~numbers.missing[rows].all(axis=1))
        given = self.frame.select(name_of(index) for index in columns)[rows]
        return given.select(pl.any_horizontal(pl.all().is_not_null())).to_series(0).to_numpy()

    def _parsed(self, columns: Sequence[int]) -> "Numbers":
        frame = self.frame.select(name_of(index) for index in columns)
        missing = frame.select(pl.all().is_null()).to_numpy(writable=True)
        return Numbers(frame.to_numpy(order="fortran", writable=True), missing)


def quotes_close(data: bytes) -> bool:
    """Whether each line closes the quotes that it opens; polars lets one left open run on into further lines."""
    return b'"' not in data or all(line.count(b'"') % 2 == 0 for line in data.split(b"\n"))


def _quotes_end_fields(data: bytes, delimiter: str) -> bool:
    """Whether nothing stands behind the closing quote of a field, as in `"Valve"s`: polars takes the last byte away
    there, which may be half a letter. Quotes are counted first, which is quick."""
    end = delimiter.encode()
    at_ends = sum(data.count(text) for text in (end + b'"', b'\n"', b'"' + end, b'"\n', b'"\r')) + data.startswith(b'"')
    return at_ends == data.count(b'"') or not _text_behind_quotes(end).search(data)


@lru_cache
def _text_behind_quotes(delimiter: bytes) -> re.Pattern[bytes]:
    other = re.escape(delimiter) + rb'\r\n"'
    return re.compile(rb'(?:[^%b]"|(?:^|[\n%b])"")[^%b]' % (other, re.escape(delimiter), other))


@dataclass(frozen=True, eq=False)
class Numbers:
    """`values` (rows, columns); `missing`, where none could be read, or not for sure: it is NaN, or has its point taken
    for one before decimals. Columns stand whole."""

    values: NDArray[np.float64]
    missing: NDArray[np.bool_]

    def of(self, columns: Sequence[int]) -> "Numbers":
        """Some columns; no copy where they stand side by side."""
        at: slice | Sequence[int] = columns
        if len(columns) and list(columns) == list(range(columns[0], columns[-1] + 1)):
            at = slice(columns[0], columns[-1] + 1)
        return Numbers(self.values[:, at], self.missing[:, at])


UNREADABLE = (pl.exceptions.PolarsError, pl.exceptions.PanicException)
"""What polars raises at bytes that it cannot read: its own errors, and a panic where its core did not expect them."""


def in_short(error: BaseException) -> str:
    """What polars says, without the advice that follows on further lines."""
    return str(error).partition("\n")[0][:200]


class RowReader(Protocol):
    """Gives a file's rows as frames; what the readers of tables ask of a file, be it text or typed."""

    @property
    def most_columns(self) -> int | None:
        """How many columns `rows` should be asked for at once, where it can give some without the others."""
        ...

    def of_text(self, columns: Sequence[int]) -> frozenset[int]:
        """Those of the columns that are text in the file."""
        ...

    def scanning(self, plan: LongPlan) -> Scanner | None:
        """Has plain rows read by a scanner from now on; None where they are not text."""
        ...

    def rows(self, first_row: int, columns: Sequence[int] | None = None) -> Iterator[Rows]: ...

    def parted(self, rows: Rows) -> Rows:
        """Rows that were scanned, in frames."""
        ...

    def texts(self, rows: Rows, columns: Sequence[int]) -> pl.DataFrame: ...

    def short_rows(self, rows: Rows, candidates: NDArray[np.int64]) -> NDArray[np.int64]: ...


class FrameReader:
    """Reads the columns asked for, with their types, from a text file; counts ragged rows and open quotes."""

    most_columns = None

    def __init__(
        self,
        file: TextFile,
        dialect: Dialect,
        types: dict[int, pl.DataType],
        log: RejectLog,
        in_file: Callable[[int], int] = int,
    ) -> None:
        """in_file: by row of the file's head, which row of the file it is."""
        self._file, self._in_file = file, in_file
        self._dialect = dialect
        self._types = {name_of(index): types.get(index, pl.String()) for index in range(dialect.width)}
        self._columns = sorted(types)
        self._texts = [index for index in self._columns if types[index] != pl.Float64]
        self._blocks = len(self._columns) - len(self._texts) >= BLOCK_COLUMNS
        self._log = log
        self._scanner: Scanner | None = None
        self._compiled = False  # what is compiled pays, from the first large chunk on
        self._told_to = 0  # the last line whose fault was told: rows may be read once more

    def of_text(self, columns: Sequence[int]) -> frozenset[int]:
        return frozenset(columns)

    def scanning(self, plan: LongPlan) -> Scanner | None:
        self._scanner = Scanner(plan, self._dialect.delimiter, self._dialect.decimal_mark, self._dialect.marks_doubtful)
        return self._scanner

    def rows(self, first_row: int, columns: Sequence[int] | None = None) -> Iterator[Rows]:
        """All rows from the given one (counted from 0) on, with all columns: text holds them side by side."""
        for rows in side_by_side(self._read, ahead(self._chunks_from(self._in_file(first_row)))):
            self._tell_faults(rows)
            yield rows

    def parted(self, rows: Rows) -> Rows:
        rows = self._part(Lines(rows.data, rows.first, rows.height))
        self._tell_faults(rows)
        return rows

    def _tell_faults(self, rows: Rows) -> None:
        for code, text, line in rows.faults:
            if line > self._told_to:
                self._log.add(code, text, line)
                self._told_to = line

    def _chunks_from(self, first_row: int) -> Iterator[Lines]:
        to_skip = first_row
        for lines in self._file.chunks():
            while to_skip and lines.data:
                end = lines.data.find(b"\n") + 1
                lines = Lines(lines.data[end:], lines.first + 1, lines.count - 1)
                to_skip -= 1
            self._compiled = self._compiled or len(lines.data) >= LEAST_BYTES
            yield from (part for part in parts_between(lines) if part.data and not part.data.isspace())

    def texts(self, rows: Rows, columns: Sequence[int]) -> pl.DataFrame:
        """Columns of the rows as the text they were written in."""
        schema: dict[str, pl.DataType] = {name: pl.String() for name in self._types}
        try:
            texts = self._parse(rows.data, schema, sorted(columns), decimal_comma=False)
            if texts.height == rows.frame.height:
                return texts
        except UNREADABLE:
            pass  # as text polars is stricter about quotes than as numbers
        return self._split(rows, sorted(columns))

    def _split(self, rows: Rows, columns: Sequence[int]) -> pl.DataFrame:
        """The same line by line, whatever the quotes are."""
        lines = rows.data.decode("utf-8", "replace").split("\n")[: rows.frame.height]
        fields = [split_line(line, self._dialect.delimiter) for line in lines]
        taken = {name_of(i): [row[i] or None if i < len(row) else None for row in fields] for i in columns}
        return pl.DataFrame(taken, schema=dict.fromkeys(taken, pl.String))

    def short_rows(self, rows: Rows, candidates: NDArray[np.int64]) -> NDArray[np.int64]:
        """Those of the candidates whose lines have too few fields, but for empty lines and comments."""
        if not len(candidates):
            return candidates
        data, delimiter = rows.data, self._dialect.delimiter.encode()
        need, others = self._dialect.width - 1, self._dialect.ends
        ends = np.append(np.flatnonzero(np.frombuffer(data, dtype=np.uint8) == ord("\n")), len(data))
        begins = np.append(0, ends[:-1] + 1)
        filled = candidates[begins[candidates] < ends[candidates]]
        counts = _counts_between(data, delimiter, begins[filled], ends[filled])
        few = filled[(counts < need) & ~np.isin(counts + 1, list(others))]
        lines = (data[begins[row] : ends[row]] for row in few)
        return few[[line.strip(b' "\r')[:1] not in NO_ROW for line in lines]]

    def _schema(self) -> dict[str, pl.DataType]:
        """Of one chunk: the numbers of its texts are let go with it."""
        return {
            name: pl.Categorical(pl.Categories.random()) if kind is NUMBERED else kind
            for name, kind in self._types.items()
        }

    def _read(self, lines: Lines) -> Rows:
        data, blank = with_empty_lines(lines.data)
        lines = lines if data is lines.data else replace(lines, data=data)
        scan = self._scanner.read(lines) if self._scanner and self._compiled else None
        rows = self._part(lines) if scan is None else Rows(pl.DataFrame(), lines.first, lines.data, scan=scan)
        return replace(rows, blank=blank)

    def _part(self, lines: Lines) -> Rows:
        rows = self._read_in_kinds(lines) or self._read_chunk(lines, self._dialect.decimal_comma)
        if rows.kinds is None and self._dialect.points_doubtful and has_points(rows.data, self._dialect.delimiter):
            numbers = [index for index in self._columns if index not in self._texts]
            rows = replace(rows, pointed=pointed(self.texts(rows, numbers)))
        for name in rows.frame.columns:
            if self._types[name] is NUMBERED and rows.frame[name].n_unique() > rows.frame.height // 2:
                self._types[name] = pl.String()  # it hardly repeats: numbering costs more than it saves
        return rows

    def _read_in_kinds(self, lines: Lines) -> Rows | None:
        """A chunk whose marks are in doubt, with the kinds of its fields. None where these are not seen."""
        dialect = self._dialect
        looked_at = dialect.marks_doubtful and self._compiled
        kinds = kinds_of(lines.data, dialect.delimiter, dialect.width) if looked_at else None
        if kinds is None:
            return None
        rows = self._read_chunk(lines, decimal_comma=bool(np.any(kinds & WITH[","])))
        return replace(rows, kinds=kinds)

    def _read_block(self, lines: Lines, decimal_comma: bool) -> Rows | None:
        """A chunk of plain rows, all of full length: its fields are one column of numbers to polars, and only the
        columns of text are parted. None where it is no such chunk. Without quotes, polars gives a line a row."""
        delimiter, width = self._dialect.delimiter.encode(), self._dialect.width
        if b'"' in lines.data or not _all_have(lines, delimiter, width - 1):
            return None
        try:
            fields = self._parse(
                lines.data.replace(delimiter, b"\n"), {FIELD: pl.Float64()}, [0], decimal_comma, BETWEEN_FIELDS
            )
            frame = self._first_fields(lines)
            if frame is None:
                frame = self._parse(lines.data, self._schema(), self._texts, decimal_comma)
        except (*UNREADABLE, UnicodeDecodeError):
            return None
        shape = (lines.count, width)
        column = fields[FIELD]
        missing = np.asfortranarray(column.is_null().to_numpy().reshape(shape))
        block = Numbers(np.asfortranarray(column.to_numpy(writable=True).reshape(shape)), missing)
        return Rows(frame, lines.first, lines.data, block=block)

    def _first_fields(self, lines: Lines) -> pl.DataFrame | None:
        """The columns of text where they are a line's first ones: the thousands of fields behind them stay unparted.
        None where they are others. The lines hold no quotes."""
        if not self._texts or self._texts[-1] >= MOST_FIRST:
            return None
        if any(self._types[name_of(index)] != pl.String() for index in self._texts):
            return None
        delimiter, behind = self._dialect.delimiter.encode(), self._texts[-1] + 1
        rows = [line.split(delimiter, behind)[:behind] for line in lines.data.split(b"\n")[: lines.count]]
        texts = {name_of(index): [row[index].decode() or None for row in rows] for index in self._texts}
        return pl.DataFrame(texts, schema=dict.fromkeys(texts, pl.String))

    def _read_chunk(self, lines: Lines, decimal_comma: bool) -> Rows:
        rows = self._read_block(lines, decimal_comma) if self._blocks else None
        if rows is not None:
            return rows
        if quotes_close(lines.data) and _quotes_end_fields(lines.data, self._dialect.delimiter):
            uneven = self._uneven(lines.data, lines.count)
            try:
                frame = self._parse(lines.data, self._schema(), self._columns, decimal_comma)
                if frame.height == lines.count and not self._any_fault(lines.data, uneven):
                    return Rows(frame, lines.first, lines.data, fewer=uneven.fewer if uneven else None)
            except UNREADABLE:
                pass  # the chunk has odd rows: they are found line by line
        data, faults = self._cleaned(lines)
        uneven = self._uneven(data, lines.count)
        frame = self._parse(data, self._schema(), self._columns, decimal_comma)
        return Rows(frame, lines.first, data, faults, fewer=uneven.fewer if uneven else None)

    def _uneven(self, data: bytes, count: int) -> Uneven | None:
        """None where polars parts all columns, and counts them."""
        if len(self._columns) == self._dialect.width:
            return None
        return uneven_lines(data, self._dialect.delimiter, self._dialect.width, count)

    def _any_fault(self, data: bytes, uneven: Uneven | None) -> bool:
        """Whether a line has something in a field too many."""
        if uneven is None or not len(uneven.more):
            return False
        lines = data.split(b"\n", int(uneven.more[-1]) + 1)
        return any(self._fault(lines[at].decode("utf-8", "replace").rstrip("\r")) for at in uneven.more)

    def _parse(
        self,
        data: bytes,
        schema: dict[str, pl.DataType],
        columns: list[int],
        decimal_comma: bool,
        separator: str = "",
    ) -> pl.DataFrame:
        return pl.read_csv(
            io.BytesIO(data),
            has_header=False,
            schema=schema,
            columns=None if len(columns) == len(schema) else columns,
            separator=separator or self._dialect.delimiter,
            decimal_comma=decimal_comma and self._dialect.delimiter != ",",
            quote_char='"' if b'"' in data else None,
            ignore_errors=True,
            missing_columns="insert",
        )

    def _cleaned(self, lines: Lines) -> tuple[bytes, tuple[tuple[str, str, int], ...]]:
        """The same number of lines; those that cannot be split stand empty and are told."""
        empty = self._dialect.delimiter * (self._dialect.width - 1)
        cleaned = []
        faults = []
        for number, line in enumerate(lines.data.decode("utf-8", "replace").split("\n")[:-1], start=lines.first):
            line = line.replace("\r", "").replace("\0", "\N{REPLACEMENT CHARACTER}")
            why = self._fault(line)
            if why:
                faults.append((why, line, number))
            cleaned.append(empty if why or not line.strip() else self._rejoined(line))
        return ("\n".join(cleaned) + "\n").encode(), tuple(faults)

    def _fault(self, line: str) -> str:
        if line.count('"') % 2:
            return "unbalanced_quote"
        if line.count(self._dialect.delimiter) < self._dialect.width:
            return ""
        fields = split_line(line, self._dialect.delimiter)
        return "ragged_row" if len(fields) > self._dialect.width and any(fields[self._dialect.width :]) else ""

    def _rejoined(self, line: str) -> str:
        """A line whose quotes stand inside its fields, or with empty fields at its end, in a form that splits."""
        fields = split_line(line, self._dialect.delimiter)
        if '"' not in line and len(fields) <= self._dialect.width:
            return line
        delimiter = self._dialect.delimiter
        fields = fields[: self._dialect.width]
        return delimiter.join(
            f'"{text.replace(chr(34), chr(39))}"' if delimiter in text or '"' in text else text for text in fields
        )


def _counts_between(
    data: bytes, delimiter: bytes, begins: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(n,) how often the delimiter stands in each of the lines, which are few of many or, below a column that is mostly
    empty, nearly all."""
    if len(begins) < MANY_LINES:
        bounds = zip(begins.tolist(), ends.tolist(), strict=True)
        return np.array([data.count(delimiter, begin, end) for begin, end in bounds], dtype=np.int64)
    at = np.flatnonzero(np.frombuffer(data, dtype=np.uint8) == delimiter[0])
    return np.searchsorted(at, ends) - np.searchsorted(at, begins)


def _all_have(lines: Lines, delimiter: bytes, count: int) -> bool:
    """Whether the delimiter stands in each line so often."""
    start = 0
    for _ in range(lines.count):
        end = lines.data.find(b"\n", start)
        if lines.data.count(delimiter, start, end) != count:
            return False
        start = end + 1
    return True
