"""Units that stand beside the values of a long table, row by row."""

from collections import Counter

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.numbers.units import plain_unit

UNKNOWN = -1

Codes = NDArray[np.uint32]
Where = NDArray[np.bool_]


class UnitColumn:
    """The unit of each tag, as most rows of the table have it that were `seen`, of equal ones the earlier: a value in
    another one is none of the same quantity. Tags are told by their codes."""

    def __init__(self) -> None:
        self._written: list[str] = []  # by number of the unit, as it came first
        self._number_of: dict[str, int] = {}
        self._times: dict[int, Counter[int]] = {}  # by tag, of its units in the order in which they came
        self._of_tag = np.zeros(0, dtype=np.int64)

    def of(self, tag: int) -> str:
        """Empty where none stands beside the tag."""
        number = int(self._of_tag[tag]) if tag < len(self._of_tag) else UNKNOWN
        return "" if number == UNKNOWN else self._written[number]

    def see(self, texts: pl.Series, tags: Codes, kept: Where) -> None:
        """texts (n,), tags (n,) of rows; kept (n,): those that count."""
        units = self._numbers(texts)
        self._room_for(tags)
        told = kept & (units != UNKNOWN)
        pairs, first, times = np.unique(
            np.stack((tags[told].astype(np.int64), units[told])), axis=1, return_index=True, return_counts=True
        )
        for at in np.argsort(first):
            tag, unit = int(pairs[0, at]), int(pairs[1, at])
            self._times.setdefault(tag, Counter())[unit] += int(times[at])
        for tag in np.unique(pairs[0]).tolist():
            ((self._of_tag[tag], _),) = self._times[tag].most_common(1)

    def in_others(self, texts: pl.Series, tags: Codes, kept: Where) -> Where:
        """(n,) whether a row's unit is another one than its tag's."""
        units = self._numbers(texts)
        self._room_for(tags)
        of_tag = self._of_tag[tags]
        return np.asarray(kept & (units != UNKNOWN) & (units != of_tag) & (of_tag != UNKNOWN))

    def _numbers(self, texts: pl.Series) -> NDArray[np.int64]:
        numbers = {text: self._number(text) for text in texts.unique(maintain_order=True).drop_nulls()}
        return texts.replace_strict(numbers, default=UNKNOWN, return_dtype=pl.Int64).to_numpy()

    def _room_for(self, tags: Codes) -> None:
        more = int(tags.max(initial=0)) + 1 - len(self._of_tag)
        self._of_tag = np.append(self._of_tag, np.full(max(more, 0), UNKNOWN))

    def _number(self, text: str) -> int:
        unit = plain_unit(text)
        if not unit:
            return UNKNOWN
        if unit not in self._number_of:
            self._number_of[unit] = len(self._written)
            self._written.append(text.strip())
        return self._number_of[unit]
