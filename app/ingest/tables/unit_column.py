"""Units that stand beside the values of a long table, row by row."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.numbers.units import plain_unit

UNKNOWN = -1


class UnitColumn:
    """The unit of each tag, as most of its rows have it in the chunk that brings it: a value in another one is none of
    the same quantity. Tags are told by their numbers."""

    def __init__(self) -> None:
        self._written: list[str] = []  # by number of the unit, as it came first
        self._number_of: dict[str, int] = {}
        self._of_tag = np.zeros(0, dtype=np.int64)

    def of(self, tag: int) -> str:
        """Empty where none stands beside the tag."""
        number = int(self._of_tag[tag]) if tag < len(self._of_tag) else UNKNOWN
        return "" if number == UNKNOWN else self._written[number]

    def in_others(self, texts: pl.Series, tags: NDArray[np.uint32], kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(n,) whether a row's unit is another one than its tag's. texts (n,), tags (n,) of rows; kept (n,): those that
        count."""
        numbers = {text: self._number(text) for text in texts.unique().drop_nulls()}
        units = texts.replace_strict(numbers, default=UNKNOWN, return_dtype=pl.Int64).to_numpy()
        more = int(tags.max(initial=0)) + 1 - len(self._of_tag)
        self._of_tag = np.append(self._of_tag, np.full(max(more, 0), UNKNOWN))
        told = kept & (units != UNKNOWN)
        self._learn(tags[told].astype(np.int64), units[told])
        of_tag = self._of_tag[tags]
        return np.asarray(told & (units != of_tag) & (of_tag != UNKNOWN))

    def _learn(self, tags: NDArray[np.int64], units: NDArray[np.int64]) -> None:
        new = self._of_tag[tags] == UNKNOWN
        pairs, first, counts = np.unique(
            np.stack((tags[new], units[new])), axis=1, return_index=True, return_counts=True
        )
        for at in np.lexsort((-first, counts)):  # the most frequent one of a tag last, of equal ones the earlier
            self._of_tag[pairs[0, at]] = pairs[1, at]

    def _number(self, text: str) -> int:
        unit = plain_unit(text)
        if not unit:
            return UNKNOWN
        if unit not in self._number_of:
            self._number_of[unit] = len(self._written)
            self._written.append(text.strip())
        return self._number_of[unit]
