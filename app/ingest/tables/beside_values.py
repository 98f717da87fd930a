"""What stands beside the values of a long table: words of states and units, judged by all rows of their tags."""

from collections.abc import Iterator

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.plans import LongPlan, name_of
from app.ingest.tables.cells import Cells
from app.ingest.tables.state_words import StateWords
from app.ingest.tables.unit_column import UnitColumn

Where = NDArray[np.bool_]
Named = slice | NDArray[np.int64]


class BesideValues:
    """`see` values before they are judged, where it is `asked`; those of all rows where they are not settled."""

    def __init__(self, plan: LongPlan) -> None:
        self._state, self._unit = plan.state, plan.unit
        self._words, self._units = StateWords(), UnitColumn()

    @property
    def asked(self) -> bool:
        return self._state is not None or self._unit is not None

    @property
    def is_settled(self) -> bool:
        """Whether all rows that were seen by now have those judged before judged as they were."""
        return self._words.is_settled and self._units.is_settled

    def see(self, cells: Cells) -> None:
        found = cells.numbers()
        named: Named = slice(None)
        if cells.tags.null_count():  # blank lines are of no tag
            named = np.flatnonzero(cells.tags.is_not_null().to_numpy())
        numbers = np.where(found.missing[:, 0], np.nan, found.values[:, 0])[named]
        codes = cells.codes()[named]
        if self._state is not None:
            self._words.see(_texts(cells, self._state)[named], codes, numbers)
        if self._unit is not None:
            self._units.see(_texts(cells, self._unit)[named], codes, np.isfinite(numbers))

    def states(self, cells: Cells, modes: Where, empty: Where) -> pl.Series | None:
        """(n,) the words that stand for values; None where the table has no column of them. modes, empty (n,): whether
        a value is one of a mode, and whether there is no number."""
        if self._state is None:
            return None
        return self._words.for_values(_texts(cells, self._state), cells.codes(), modes, empty)

    def in_other_units(self, cells: Cells, kept: Where) -> Iterator[tuple[NDArray[np.int64], Iterator[str]]]:
        """Which of the values `kept` are in another unit than their tag's, and what is said of each."""
        if self._unit is None:
            return
        texts, codes = _texts(cells, self._unit), cells.codes()
        at = np.flatnonzero(self._units.in_others(texts, codes, kept))
        yield at, (f"in {texts[int(row)]}, and its tag is in {self._units.of(int(codes[row]))}" for row in at)

    def unit_of(self, code: int) -> str:
        """Of a tag; empty where none stands beside it."""
        return self._units.of(code)


def _texts(cells: Cells, column: int) -> pl.Series:
    return cells.rows.frame[name_of(column)]
