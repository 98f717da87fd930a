"""Further rows of names in a wide table, as where exports were put one behind the other in one file. What stands below
other names than the first ones is of other columns."""

import re
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.joined_stamps import stamps_of_rows
from app.ingest.columns.names import name_at
from app.ingest.columns.plans import TimedColumns, name_of
from app.ingest.numbers.units import is_unit, plain_unit
from app.ingest.tables.frames import RowReader, Rows
from app.ingest.tags.grouping import unit_of, without_unit

_BLANKS = "[ \t\u00a0\u2007\u202f]+"
_ROUND = " '\""  # may stand around a name


class FurtherNames:
    """Looks for them chunk by chunk, in the order of the rows."""

    def __init__(self, names: tuple[str, ...], groups: Sequence[TimedColumns]) -> None:
        """names: the first ones; empty where it is not known which these are."""
        self._written, self._values = names, groups[0].values
        times = [self._first(at) for at in groups[0].time]
        self._time = stamps_of_rows([times], range(len(times)))[0]
        self._possible = len(groups) == 1 and all(times)
        self._under_others = False
        self.lines: list[int] = []  # in which other names stand

    def _first(self, column: int) -> str:
        """Its first name."""
        return _plain(name_at(self._written, column))

    @cached_property
    def _names(self) -> dict[int, str]:
        """By column of values the first name, without its unit."""
        named = {value.index: self._first(value.index) for value in self._values}
        return {at: without_unit(name) for at, name in named.items() if name}

    @cached_property
    def _units(self) -> dict[int, str]:
        """By column of values the unit that its first name tells, or a row below it."""
        units = {value.index: unit_of(self._first(value.index)) or value.unit for value in self._values}
        return {at: plain_unit(unit) for at, unit in units.items() if unit}

    def below_others(
        self, rows: Rows, reader: RowReader, times: pl.Series, timed: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Which rows stand below other names, in this chunk or since an earlier one."""
        below = np.full(len(timed), self._under_others)
        for at in self._found(times, timed):
            self._under_others = self._are_others(rows, reader, at)
            below[at + 1 :] = self._under_others
            if self._under_others:
                self.lines += rows.lines(np.array([at]))
        return below & timed

    def _found(self, times: pl.Series, timed: NDArray[np.bool_]) -> Sequence[int]:
        """The rows that have the name of the times in their place."""
        if not self._possible or timed.all():
            return ()
        untimed = np.flatnonzero(~timed)
        texts = times[untimed].cast(pl.String).str.replace_all(_BLANKS, " ").str.strip_chars(_ROUND)
        return untimed[(texts.str.to_lowercase() == self._time).fill_null(False).to_numpy()].tolist()

    def _are_others(self, rows: Rows, reader: RowReader, at: int) -> bool:
        """Names that are missing say nothing, and of a row that was cut short the last one may be cut."""
        texts = reader.texts(rows, list(self._names))
        names = {column: _plain(texts[name_of(column)][at] or "") for column in self._names}
        written = [(without_unit(name), self._names[column]) for column, name in names.items() if name]
        if not written:
            return self._under_others
        name, first = written.pop()
        last_is_other = name != first if names[max(names)] else not first.startswith(name)
        return last_is_other or any(name != first for name, first in written) or self._are_in_others(texts, names, at)

    def _are_in_others(self, texts: pl.DataFrame, names: Mapping[int, str], at: int) -> bool:
        """Whether a column has another unit than below the first names: in its name, or in a row of units below it."""
        below = {column: texts[name_of(column)][at + 1] or "" for column in names} if at + 1 < texts.height else {}
        are_units = all(map(is_unit, filter(None, below.values())))
        told = {column: unit_of(name) or (below.get(column, "") if are_units else "") for column, name in names.items()}
        return any(unit and plain_unit(unit) != self._units.get(at, plain_unit(unit)) for at, unit in told.items())


def _plain(name: str) -> str:
    return re.sub(_BLANKS, " ", name).strip(_ROUND).lower()
