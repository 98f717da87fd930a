"""Columns of values: text in numeric columns, numbers that are none, sentinels. What is refused becomes NaN and is
counted."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.marks import DOUBTFUL, GROUPED, WHOLE, DoubtfulMarks, before_decimals, other_mark
from app.ingest.model import FloatArray
from app.ingest.rejecting import RejectLog
from app.ingest.stamps import to_numbers
from app.ingest.units import UnitsOfTags

SENTINELS = (-9999.0, -99.125)
_BETWEEN_DIGITS = "['\N{RIGHT SINGLE QUOTATION MARK}\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}]"  # never decimal marks


@dataclass
class Writing:
    """How a file writes numbers that are not plain. thousands: the mark between them, empty as long as the file does
    not tell it from the decimal mark; what is in doubt until then is left to `marks`. units: behind the numbers of each
    tag."""

    thousands: str = ""
    units: UnitsOfTags = field(default_factory=UnitsOfTags)
    marks: DoubtfulMarks = field(default_factory=DoubtfulMarks)

    def learn(self, texts: pl.Series, tags: pl.Series, beside: Callable[[], pl.DataFrame]) -> None:
        """Looks for what tells thousands from decimals, before numbers are read. beside: tag and number of what was
        read without a mark."""
        if self.thousands:
            return
        sure = [mark for mark in ",." if texts.str.contains(before_decimals(mark)).any()]
        if len(sure) == 1:
            self.thousands = other_mark(sure[0])
            return
        doubtful = texts.str.extract(DOUBTFUL)
        if doubtful.null_count() < len(doubtful):
            with_unit = pl.DataFrame({"tag": tags, "number": to_numbers(texts.str.extract(WHOLE))})
            without_mark = pl.concat((beside(), with_unit)).filter(~pl.col("number").is_in(SENTINELS))
            self.marks.look(pl.DataFrame({"tag": tags, "number": to_numbers(doubtful)}), without_mark)

    def whole(self, texts: pl.Series, tags: pl.Series) -> pl.Series:
        """Texts with the thousands of their numbers joined, null where it is not clear which these are."""
        texts = _joined(texts, GROUPED % (_BETWEEN_DIGITS, "[.,]"), _BETWEEN_DIGITS)
        if not self.thousands:
            return self._by_tag(texts, tags)
        texts = self._as_before(texts, tags)
        decimal_mark = other_mark(self.thousands)
        of_decimals = tags.filter(texts.str.contains(before_decimals(self.thousands)).fill_null(False)).unique()
        others = ~tags.is_in(of_decimals.implode())
        return _joined(texts, GROUPED % (f"[{self.thousands}]", f"[{decimal_mark}]"), f"[{self.thousands}]", others)

    def _as_before(self, texts: pl.Series, tags: pl.Series) -> pl.Series:
        """Null where a tag's doubtful marks were read otherwise before the file told them: none is read both ways."""
        at = tags.is_in(self.marks.met()) & texts.str.contains(DOUBTFUL).fill_null(False)
        if at.any():
            before = tags.replace_strict({tag: self.marks.meant(tag) for tag in tags.filter(at).unique()}, default=None)
            are_thousands = texts.str.contains(self.thousands, literal=True)
            texts = texts.set(at & ((before == "thousands") != are_thousands).fill_null(False), None)
        return texts

    def _by_tag(self, texts: pl.Series, tags: pl.Series) -> pl.Series:
        at = texts.str.contains(DOUBTFUL).fill_null(False)
        if at.any():
            found = {tag: self.marks.meant(tag) for tag in tags.filter(at).unique(maintain_order=True)}
            meant = tags.replace_strict(found, default=None, return_dtype=pl.String)
            thousands = at & (meant == "thousands").fill_null(False)
            texts = texts.zip_with(~thousands, texts.str.replace_all("[.,]", ""))
            texts = texts.set(at & (meant == "").fill_null(False), None)
        return texts


def _joined(texts: pl.Series, form: str, marks: str, where: pl.Series | bool = True) -> pl.Series:
    at = texts.str.contains(form).fill_null(False) & where
    return texts.zip_with(~at, texts.str.replace_all(marks, "")) if at.any() else texts


@dataclass(frozen=True, eq=False)
class OddNumbers:
    """values (n,): NaN where there is none. refused: by code, which of the texts say something else."""

    values: FloatArray
    refused: dict[str, NDArray[np.int64]]


def refused_as(code: str, text: str) -> str:
    return f"{text.strip()} may have decimals or parted thousands" if code == "unclear_mark" else text


def odd_numbers(texts: pl.Series, tags: pl.Series, writing: Writing) -> OddNumbers:
    """The numbers among texts that the fast reader could not read."""
    whole = writing.whole(texts, tags)
    numbers = to_numbers(whole).copy()
    odd = np.flatnonzero(~np.isfinite(numbers) & says_something(whole))
    if len(odd):
        numbers[odd] = writing.units.read(whole[odd], tags[odd])
    unclear = np.flatnonzero((whole.is_null() & texts.is_not_null()).to_numpy())
    return OddNumbers(numbers, {"not_a_number": odd[np.isnan(numbers[odd])], "unclear_mark": unclear})


def numbers_of(texts: pl.Series, tag: str) -> FloatArray:
    """The numbers among texts of a tag, NaN where there is none."""
    writing, tags = Writing(), same_tag(tag, len(texts))
    writing.learn(texts, tags, lambda: pl.DataFrame(schema={"tag": pl.String, "number": pl.Float64}))
    return odd_numbers(texts, tags, writing).values


def same_tag(tag: str, count: int) -> pl.Series:
    return pl.repeat(tag, count, dtype=pl.String, eager=True)


def says_something(texts: pl.Series) -> NDArray[np.bool_]:
    return (texts.str.strip_chars(' "').str.len_bytes() > 0).fill_null(False).to_numpy()


def refuse_texts(texts: pl.Series, lines: list[int], tag: str, writing: Writing, log: RejectLog) -> FloatArray:
    """The numbers among texts of a tag; the others are refused with their text as the reason."""
    found = odd_numbers(texts, same_tag(tag, len(texts)), writing)
    for code, at in found.refused.items():
        log.add_many(code, [lines[i] for i in at], (refused_as(code, texts[int(i)]) for i in at), tag)
    return found.values


def is_sentinel(values: FloatArray) -> NDArray[np.bool_] | None:
    """Where a value of a kind that historians write for 'no data' stands clear of all the others; None where it
    nowhere does.

    -9999 among values around -10000 is a value; a sentinel lies further from the others than they lie from each other.
    """
    found = np.zeros(len(values), dtype=bool)
    for sentinel in SENTINELS:
        at = values == sentinel
        if np.any(at) and _stands_clear(values[~at], sentinel):
            found |= at
    return found if np.any(found) else None


def _stands_clear(others: FloatArray, sentinel: float) -> bool:
    others = others[np.isfinite(others) & ~np.isin(others, SENTINELS)]
    if not len(others):
        return True
    low, high = float(others.min()), float(others.max())
    span = high - low
    return sentinel < low - span or sentinel > high + span


def refuse_sentinels(values: FloatArray, lines: NDArray[np.integer[Any]], tag: str, log: RejectLog) -> FloatArray:
    found = is_sentinel(values)
    if found is None:
        return values
    log.add_many(
        "sentinel",
        [int(line) for line in lines[found]],
        (f"{value:g} stands for no data" for value in values[found]),
        tag,
    )
    return np.where(found, np.nan, values)
