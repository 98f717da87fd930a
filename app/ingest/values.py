"""Columns of values: text in numeric columns, numbers that are none, sentinels. What is refused becomes NaN and is
counted."""

from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.model import FloatArray
from app.ingest.rejecting import RejectLog
from app.ingest.stamps import to_numbers
from app.ingest.units import UnitsOfTags

SENTINELS = (-9999.0, -99.125)


def odd_numbers(texts: pl.Series, tags: pl.Series, units: UnitsOfTags) -> tuple[FloatArray, NDArray[np.int64]]:
    """The numbers among texts that the fast reader could not read, NaN where there is none, and which of the texts say
    something else."""
    numbers = to_numbers(texts).copy()
    odd = np.flatnonzero(~np.isfinite(numbers) & says_something(texts))
    if len(odd):
        numbers[odd] = units.read(texts[odd], tags[odd])
    return numbers, odd[np.isnan(numbers[odd])]


def numbers_of(texts: pl.Series, tag: str) -> FloatArray:
    """The numbers among texts of a tag, NaN where there is none."""
    return odd_numbers(texts, pl.repeat(tag, len(texts), dtype=pl.String, eager=True), UnitsOfTags())[0]


def says_something(texts: pl.Series) -> NDArray[np.bool_]:
    return (texts.str.strip_chars(' "').str.len_bytes() > 0).fill_null(False).to_numpy()


def refuse_texts(texts: pl.Series, lines: list[int], tag: str, units: UnitsOfTags, log: RejectLog) -> FloatArray:
    """The numbers among texts of a tag; the others are refused with their text as the reason."""
    numbers, bad = odd_numbers(texts, pl.repeat(tag, len(texts), dtype=pl.String, eager=True), units)
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
