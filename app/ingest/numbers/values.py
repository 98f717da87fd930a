"""Columns of values: text in numeric columns, numbers that are none, sentinels. What is refused becomes NaN and is
counted."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.model import FloatArray
from app.ingest.numbers.no_data import NO_WORD
from app.ingest.numbers.signs import with_minus_before
from app.ingest.numbers.writing import Writing
from app.ingest.rejecting import RejectLog
from app.ingest.times.time_reader import to_numbers

_MINUS = "[\N{MINUS SIGN}\N{EN DASH}]"  # as programs write it in the north of Europe, and what they make of it
_BLANK = "[\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}]"
_ROUND = rf"^[ \"]*{_BLANK}+|{_BLANK}+[ \"]*$"


@dataclass(frozen=True, eq=False)
class OddNumbers:
    """values (n,): NaN where there is none. refused: by code, which of the texts say something else."""

    values: FloatArray
    refused: dict[str, NDArray[np.int64]]


def refused_as(code: str, text: str) -> str:
    return f"{text.strip()} may have decimals or parted thousands" if code == "unclear_mark" else text


def odd_numbers(texts: pl.Series, tags: pl.Series, writing: Writing) -> OddNumbers:
    """The numbers among texts that the fast reader could not read."""
    written = texts
    texts = with_minus_before(texts.str.replace_all(_ROUND, "").str.replace(_MINUS, "-"))
    whole = writing.whole(texts, tags)
    numbers = to_numbers(whole).copy()
    odd = np.flatnonzero(~np.isfinite(numbers) & says_something(whole))
    if len(odd):
        numbers[odd] = writing.units.read(whole[odd], tags[odd])
    writing.signs.see(written, tags, numbers)
    unclear = np.flatnonzero((whole.is_null() & texts.is_not_null()).to_numpy())
    return OddNumbers(numbers, {"not_a_number": odd[np.isnan(numbers[odd])], "unclear_mark": unclear})


def same_tag(tag: str, count: int) -> pl.Series:
    return pl.repeat(tag, count, dtype=pl.String, eager=True)


def tagged(parts: Iterable[tuple[str, pl.Series]]) -> pl.DataFrame:
    """Tag and text of the texts of each tag."""
    empty = pl.DataFrame(schema={"tag": pl.String, "text": pl.String})
    return pl.concat([empty, *(pl.DataFrame({"tag": same_tag(tag, len(t)), "text": t}) for tag, t in parts)])


def says_something(texts: pl.Series) -> NDArray[np.bool_]:
    """(n,) whether anything stands there but a word for nothing, as `NULL`."""
    return (~texts.str.strip_chars(' "').str.to_lowercase().is_in(NO_WORD)).fill_null(False).to_numpy()


def refuse_texts(texts: pl.Series, lines: list[int], tag: str, writing: Writing, log: RejectLog) -> FloatArray:
    """The numbers among texts of a tag; the others are refused with their text as the reason."""
    found = odd_numbers(texts, same_tag(tag, len(texts)), writing)
    for code, at in found.refused.items():
        log.add_many(code, [lines[i] for i in at], (refused_as(code, texts[int(i)]) for i in at), tag)
    return found.values
