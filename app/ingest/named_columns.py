"""Tables with a row of names whose columns are asked for one by one, by name or by signal: read as an export's are."""

import io
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
import polars as pl

from app.counting import counted
from app.errors import DataError
from app.ingest.columns.clocks import date_and_clock
from app.ingest.columns.joined_stamps import stamps_of
from app.ingest.columns.plans import name_of
from app.ingest.columns.time_columns import may_be_times, stamps_in, time_columns_in, times_assumed
from app.ingest.columns.time_names import time_columns
from app.ingest.files.head import HEAD_ROWS, Head, split_line
from app.ingest.files.opening import TextFile
from app.ingest.model import NO_TIME, FloatArray, IngestOptions, Signal, TimeArray
from app.ingest.numbers.marks import POINTED, DoubtfulMarks
from app.ingest.numbers.values import odd_numbers, same_tag, tagged
from app.ingest.numbers.writing import MARKED, Writing
from app.ingest.tables.frames import UNREADABLE, quotes_close
from app.ingest.tables.line_widths import uneven_lines
from app.ingest.tags.loops import signals_of
from app.ingest.times.stamps import TimeForm, find_form
from app.ingest.times.time_reader import TimeReader
from app.nanoseconds import NS_PER_S

SEPARATORS = ",;\t"
NO_VALUE = ["", "NaN", "nan", "NA", "null"]


class NamedTable:
    """Columns by name. Those of text are read together: one may tell how the others are written. damage: what of the
    file was lost on its way."""

    def __init__(
        self, frame: pl.DataFrame, options: IngestOptions, separator: str = "", damage: tuple[str, ...] = ()
    ) -> None:
        self._frame, self._options, self._separator, self.damage = frame, options, separator, damage

    @property
    def names(self) -> list[str]:
        return self._frame.columns

    @property
    def height(self) -> int:
        return self._frame.height

    def may_hold_numbers(self, name: str) -> bool:
        return self._frame[name].dtype.is_numeric() or self._frame[name].dtype == pl.String

    def numbers(self, name: str) -> FloatArray:
        """(n,) NaN where none stands."""
        column = self._frame[name]
        plain = column.cast(pl.Float64, strict=False).to_numpy(writable=True)
        if column.dtype != pl.String:
            return plain
        at = np.flatnonzero(self._written[name])
        plain[at] = odd_numbers(column[at], same_tag(name, len(at)), self._writing).values
        return plain

    def column_of(self, asked: Literal["PV", "OP", "SP", "time"]) -> str | None:
        """The column that is a signal, or the times, by its name, as in an export; None where none is. Of date and
        clock in two columns the date."""
        if asked == "time":
            return self.time_columns[0] if self.time_columns else None
        return self._signals.get(asked)

    @cached_property
    def time_columns(self) -> tuple[str, ...]:
        """The column of times, or date and clock: by name or, as in an export, by what they hold."""
        names = tuple(self.names)
        named = time_columns_in(self._head, names, 0, self._options)
        named = named or stamps_in(self._head, names, 0, self._options, of_rows=True)
        found = named or ((0,) if self._first_holds_times() else ())
        return tuple(names[index] for index in found and date_and_clock(self._head, found, names, 0, self._options))

    @property
    def times_assumed(self) -> tuple[str, ...]:
        """What was taken for times where no column is named so."""
        form = None if self.times is None or time_columns(tuple(self.names)) else self._form_of(self.times)
        if form is None or form.kind != "relative":
            return ()
        return (times_assumed(self.time_columns[0], form),)

    @cached_property
    def times(self) -> pl.Series | None:
        """(n,) the times as they are written, date and clock joined; None where no column has some."""
        if not self.time_columns:
            return None
        numbered = self._frame.rename({name: name_of(index) for index, name in enumerate(self.names)})
        at = tuple(self.names.index(name) for name in self.time_columns)
        return stamps_of(numbered, at).alias(self.time_columns[0])

    def times_s(self) -> FloatArray | None:
        """(n,) s since 1970 or, where numbers tell no instants, since a start of their own; None where no column holds
        times."""
        times = self.times
        form = None if times is None else self._form_of(times)
        if times is None or form is None:
            return None
        if form.kind == "relative":
            return self.numbers(self.time_columns[0]) * (form.scale / NS_PER_S)
        at_ns = TimeReader(form, self._options).read(times)
        return np.where(at_ns == NO_TIME, np.nan, at_ns / NS_PER_S)

    def _first_holds_times(self) -> bool:
        """Beside others, and of no name that tells a signal."""
        if len(self.names) < 2 or self.names[0] in self._signals.values():
            return False
        name = self.names[0]
        form = self._form_of(self._frame[name])
        if form is None or form.kind != "relative":
            return form is not None
        return may_be_times(name, self.numbers(name))

    def _form_of(self, times: pl.Series) -> TimeForm | None:
        return find_form(_texts(times).drop_nulls().to_list(), times.name, self._options)

    @cached_property
    def _signals(self) -> Mapping[Signal, str]:
        return signals_of(self.names)

    @cached_property
    def _head(self) -> Head:
        """The first rows as text."""
        first = pl.DataFrame([_texts(column).fill_null("").str.strip_chars() for column in self._frame.head(HEAD_ROWS)])
        return Head("", (), tuple(first.rows()), "", ".", typed=True)

    def doubts(self) -> tuple[str, ...]:
        """How numbers were read whose writing is in doubt."""
        return tuple(self._writing.doubts())

    @cached_property
    def _written(self) -> dict[str, pl.Series]:
        """By column of text, where numbers are not plain, or have a point that may part thousands."""
        return {column.name: self._is_written(column) for column in self._frame if column.dtype == pl.String}

    def _is_written(self, column: pl.Series) -> pl.Series:
        plain = column.cast(pl.Float64, strict=False).is_not_null()
        if self._separator != ",":
            plain &= ~column.str.contains(MARKED)
        return (~plain & column.is_not_null()).fill_null(False)

    @cached_property
    def _writing(self) -> Writing:
        written = [(self._frame[name], at) for name, at in self._written.items()]
        parted = self._separator == ","
        points = parted and any(column.str.contains(POINTED).any() for column, _ in written)
        writing = Writing("," if points else "", marks=DoubtfulMarks("thousands" if parted else "decimals"))
        odd = tagged((column.name, column.filter(at)) for column, at in written)
        writing.learn(odd["text"], odd["tag"], lambda: tagged((c.name, c.filter(~at)) for c, at in written))
        return writing


def _texts(column: pl.Series) -> pl.Series:
    """Empty where it holds lists or bytes."""
    plain = not column.dtype.is_nested() and column.dtype != pl.Binary
    return column.cast(pl.String) if plain else pl.Series(column.name, [None] * len(column), dtype=pl.String)


def read_named(path: Path, options: IngestOptions) -> NamedTable:
    """A delimited file, in whatever encoding and packed or not, or parquet with a row of names. Raises
    DataError("not_a_table", "empty_file", "not_an_export") where it is none."""
    try:
        if path.suffix.lower() == ".parquet":
            seconds = pl.selectors.duration().dt.total_microseconds() / 1e6
            words = (pl.selectors.categorical() | pl.selectors.enum()).cast(pl.String)
            return NamedTable(pl.read_parquet(path).with_columns(seconds, words), options)
        file = TextFile(path, options)
        text = b"".join(lines.data for lines in file.chunks()).decode("utf-8", "replace")
        return parse_named(text, options, tuple(file.notes))
    except UNREADABLE as error:
        raise DataError("not_a_table", f"{path} cannot be read as a table: {error}") from error


def parse_named(text: str, options: IngestOptions, damage: tuple[str, ...] = ()) -> NamedTable:
    """Delimited text with a row of names. Raises DataError("not_a_table") where it is none."""
    separator = max(SEPARATORS, key=text.partition("\n")[0].count)
    data, emptied = _without_long_rows(text.encode("utf-8", "replace"), separator)
    if emptied:
        left = counted(
            emptied,
            "row has more fields than there are names, and was",
            "rows have more fields than there are names, and were",
        )
        damage = (*damage, f"{left} left empty")
    try:
        frame = pl.read_csv(
            io.BytesIO(data),
            separator=separator,
            null_values=NO_VALUE,
            infer_schema=False,
            truncate_ragged_lines=True,
        )
    except UNREADABLE as error:
        raise DataError("not_a_table", f"the text cannot be read as a table: {error}") from error
    return NamedTable(frame, options, separator, damage)


def _without_long_rows(data: bytes, separator: str) -> tuple[bytes, int]:
    """With empty lines of as many fields in the place of those that have something behind the last name, which may have
    it anywhere; and how many these are. Quotes around line ends leave the data as they are."""
    if not quotes_close(data):
        return data, 0
    lines = data.split(b"\n")
    width = len(split_line(lines[0].decode(), separator))
    more = uneven_lines(data, separator, width, len(lines)).more.tolist()
    more = [at for at in more if any(split_line(lines[at].decode(), separator)[width:])]
    for at in more:
        lines[at] = separator.encode() * (width - 1)
    return b"\n".join(lines) if more else data, len(more)


def read_instants(column: pl.Series, options: IngestOptions) -> TimeArray | None:
    """(n,) ns since 1970 of stamps, seconds since 1970 or seconds since `options.start_ns`, as exports are read;
    NO_TIME where there is none. None where the column holds no times."""
    shown = column
    if column.dtype.is_numeric():
        shown = column.map_elements(lambda value: f"{value:f}", return_dtype=pl.String)
    form = find_form(shown.cast(pl.String).drop_nulls().to_list(), column.name, options)
    return None if form is None else TimeReader(form, options).read(column)
