"""Units that stand beside the values of a long table, row by row."""

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
        self._times = pl.DataFrame(schema={"tag": pl.UInt32, "unit": pl.Int64, "times": pl.UInt32})  # as they came
        self._of_tag = np.zeros(0, dtype=np.int64)
        self.is_settled = True  # whether each tag has still the unit that it had first

    def of(self, tag: int) -> str:
        """Empty where none stands beside the tag."""
        number = int(self._of_tag[tag]) if tag < len(self._of_tag) else UNKNOWN
        return "" if number == UNKNOWN else self._written[number]

    def see(self, texts: pl.Series, tags: Codes, kept: Where) -> None:
        """texts (n,), tags (n,) of rows; kept (n,): those that count."""
        units = self._numbers(texts)
        told = kept & (units != UNKNOWN)
        more = pl.DataFrame({"tag": tags[told], "unit": units[told]})
        more = more.group_by("tag", "unit", maintain_order=True).agg(pl.len().alias("times"))
        both = pl.concat((self._times, more)).group_by("tag", "unit", maintain_order=True)
        self._times = both.agg(pl.col("times").sum())
        self._room_for(tags)
        most = self._times.sort("times", descending=True, maintain_order=True).unique("tag", keep="first")
        tags, units = most["tag"].to_numpy(), most["unit"].to_numpy()
        known = self._of_tag[tags]
        self.is_settled = self.is_settled and bool(np.all((known == UNKNOWN) | (known == units)))
        self._of_tag[tags] = units

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
