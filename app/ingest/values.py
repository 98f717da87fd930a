"""Columns of values: text in numeric columns, numbers that are none, sentinels. What is refused becomes NaN and is
counted."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.model import FloatArray
from app.ingest.rejecting import RejectLog
from app.ingest.stamps import to_numbers
from app.ingest.units import UnitsOfTags

SENTINELS = (-9999.0, -99.125)
_GROUPED = r"^[ \"]*[+-]?[1-9]\d{0,2}(?:%s\d{3})+(?:%s\d+)?(?:[^\d.,].*)?$"
_DECIMAL_COMMA = r"^[ \"]*[+-]?(?:0?,\d|\d+,(?:\d{1,2}|\d{4,})(?:\D|$))"  # what thousands never look like
_BETWEEN_DIGITS = "['\N{RIGHT SINGLE QUOTATION MARK}\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}]"  # never decimal marks


@dataclass(frozen=True)
class Writing:
    """How a file writes numbers that are not plain. thousands: the mark between them, empty where the file does not
    tell it from the decimal mark. units: behind the numbers of each tag."""

    thousands: str = ""
    units: UnitsOfTags = field(default_factory=UnitsOfTags)

    def whole(self, texts: pl.Series) -> pl.Series:
        """Texts with the thousands of their numbers joined."""
        parted = [(_GROUPED % (_BETWEEN_DIGITS, "[.,]"), _BETWEEN_DIGITS)]
        if self.thousands and not (self.thousands == "," and texts.str.contains(_DECIMAL_COMMA).any()):
            mark, decimal_mark = (",", ".") if self.thousands == "," else (".", ",")
            parted.append((_GROUPED % (f"[{mark}]", f"[{decimal_mark}]"), f"[{mark}]"))
        for form, marks in parted:
            at = texts.str.contains(form).fill_null(False)
            texts = texts.zip_with(~at, texts.str.replace_all(marks, "")) if at.any() else texts
        return texts


def odd_numbers(texts: pl.Series, tags: pl.Series, writing: Writing) -> tuple[FloatArray, NDArray[np.int64]]:
    """The numbers among texts that the fast reader could not read, NaN where there is none, and which of the texts say
    something else."""
    texts = writing.whole(texts)
    numbers = to_numbers(texts).copy()
    odd = np.flatnonzero(~np.isfinite(numbers) & says_something(texts))
    if len(odd):
        numbers[odd] = writing.units.read(texts[odd], tags[odd])
    return numbers, odd[np.isnan(numbers[odd])]


def numbers_of(texts: pl.Series, tag: str) -> FloatArray:
    """The numbers among texts of a tag, NaN where there is none."""
    return odd_numbers(texts, pl.repeat(tag, len(texts), dtype=pl.String, eager=True), Writing())[0]


def says_something(texts: pl.Series) -> NDArray[np.bool_]:
    return (texts.str.strip_chars(' "').str.len_bytes() > 0).fill_null(False).to_numpy()


def refuse_texts(texts: pl.Series, lines: list[int], tag: str, writing: Writing, log: RejectLog) -> FloatArray:
    """The numbers among texts of a tag; the others are refused with their text as the reason."""
    numbers, bad = odd_numbers(texts, pl.repeat(tag, len(texts), dtype=pl.String, eager=True), writing)
    log.add_many("not_a_number", [lines[i] for i in bad], (texts[int(i)] for i in bad), tag)
    return numbers


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
