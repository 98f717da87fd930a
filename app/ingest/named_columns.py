"""Tables with a row of names whose columns are asked for one by one: read as an export's are, whatever they mean."""

import io
from functools import cached_property
from pathlib import Path

import numpy as np
import polars as pl

from app.errors import DataError
from app.ingest.model import FloatArray, IngestOptions, TimeArray
from app.ingest.numbers.marks import POINTED, DoubtfulMarks
from app.ingest.numbers.values import odd_numbers, same_tag, tagged
from app.ingest.numbers.writing import MARKED, Writing
from app.ingest.tables.frames import UNREADABLE
from app.ingest.times.stamps import NO_TIME, TimeReader, find_form
from app.nanoseconds import NS_PER_S

SEPARATORS = ",;\t"
NO_VALUE = ["", "NaN", "nan", "NA", "null"]


class NamedTable:
    """Columns by name. Those of text are read together: one may tell how the others are written."""

    def __init__(self, frame: pl.DataFrame, options: IngestOptions, separator: str = "") -> None:
        self._frame, self._options, self._separator = frame, options, separator

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

    def times_s(self, name: str) -> FloatArray | None:
        """(n,) s since 1970 or, where numbers tell no instants, since a start of their own; None where it holds no
        times."""
        column = self._frame[name]
        form = find_form(column.cast(pl.String).drop_nulls().to_list(), name, self._options)
        if form is None:
            return None
        if form.kind == "relative":
            return self.numbers(name) * (form.scale / NS_PER_S)
        at_ns = TimeReader(form, self._options).read(column)
        return np.where(at_ns == NO_TIME, np.nan, at_ns / NS_PER_S)

    def column(self, name: str) -> pl.Series:
        return self._frame[name]

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


def read_named(path: Path, options: IngestOptions) -> NamedTable:
    """A delimited file or parquet with a row of names. Raises DataError("not_a_table") where it is none."""
    try:
        if path.suffix.lower() == ".parquet":
            return NamedTable(pl.read_parquet(path), options)
        return parse_named(path.read_text(encoding="utf-8-sig", errors="replace"), options)
    except UNREADABLE as error:
        raise DataError("not_a_table", f"{path} cannot be read as a table: {error}") from error


def parse_named(text: str, options: IngestOptions) -> NamedTable:
    """Delimited text with a row of names. Raises DataError("not_a_table") where it is none."""
    separator = max(SEPARATORS, key=text.partition("\n")[0].count)
    try:
        frame = pl.read_csv(
            io.BytesIO(text.encode()),
            separator=separator,
            null_values=NO_VALUE,
            infer_schema=False,
            truncate_ragged_lines=True,
        )
    except UNREADABLE as error:
        raise DataError("not_a_table", f"the text cannot be read as a table: {error}") from error
    return NamedTable(frame, options, separator)


def read_instants(column: pl.Series, options: IngestOptions) -> TimeArray | None:
    """(n,) ns since 1970 of stamps, seconds since 1970 or seconds since `options.start_ns`, as exports are read;
    NO_TIME where there is none. None where the column holds no times."""
    shown = column
    if column.dtype.is_numeric():
        shown = column.map_elements(lambda value: f"{value:f}", return_dtype=pl.String)
    form = find_form(shown.cast(pl.String).drop_nulls().to_list(), column.name, options)
    return None if form is None else TimeReader(form, options).read(column)
