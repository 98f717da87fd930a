"""Further rows of names in a wide table, as where exports were put one behind the other in one file. What stands below
other names than the first ones is of other columns."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.plans import TimedColumns, name_of
from app.ingest.tables.frames import RowReader, Rows


class FurtherNames:
    """Looks for them chunk by chunk, in the order of the rows."""

    def __init__(self, names: tuple[str, ...], groups: Sequence[TimedColumns]) -> None:
        """names: the first ones; empty where it is not known which these are."""
        group = groups[0]
        self._first = {at: _plain(names[at]) if at < len(names) else "" for at in (*group.time, *_columns(group))}
        self._time = " ".join(self._first[at] for at in group.time)
        self._possible = len(groups) == 1 and any(names)
        self._under_others = False
        self.lines: list[int] = []  # in which other names stand

    def below_others(
        self, rows: Rows, reader: RowReader, times: pl.Series, timed: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Which rows stand below other names, in this chunk or since an earlier one."""
        below = np.full(len(timed), self._under_others)
        for at in self._found(times, timed):
            self._under_others = not self._are_first(rows, reader, at)
            below[at + 1 :] = self._under_others
            if self._under_others:
                self.lines += rows.lines(np.array([at]))
        return below & timed

    def _found(self, times: pl.Series, timed: NDArray[np.bool_]) -> Sequence[int]:
        """The rows that have the name of the times in their place."""
        if not self._possible or timed.all():
            return ()
        untimed = np.flatnonzero(~timed)
        named = times[untimed].cast(pl.String).str.strip_chars(' "').str.to_lowercase() == self._time
        return untimed[named.fill_null(False).to_numpy()].tolist()

    def _are_first(self, rows: Rows, reader: RowReader, at: int) -> bool:
        texts = reader.texts(rows, list(self._first))
        return all(_plain(texts[name_of(column)][at] or "") == name for column, name in self._first.items())


def _columns(group: TimedColumns) -> list[int]:
    return [value.index for value in group.values]


def _plain(name: str) -> str:
    return name.strip(' "').lower()
