"""Words of states that stand beside the numbers of a long table: which of them are the values."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.numbers.no_data import NO_WORD

_FEW = 0.5  # of a tag's rows


def states_for_values(
    states: pl.Series, codes: NDArray[np.uint32], modes: NDArray[np.bool_], empty: NDArray[np.bool_]
) -> pl.Series:
    """(n,) the words that stand for the values of their rows, null elsewhere: those of modes, whose numbers count the
    states of a list that the file does not have; those beside which no number is; and those that a tag has in few
    rows, which say why it has no value, whatever number they have: none that begin with a number, as 1,059.4 t/h.
    codes: (n,) of the tags. empty: (n,) without a number."""
    words = states.cast(pl.String).str.strip_chars(' "')
    told = _are_words(words)
    rows, with_words = np.bincount(codes), np.bincount(codes, weights=told)
    few = (with_words < _FEW * rows)[codes] & ~_begin_with_a_number(words)
    taken = pl.Series(told & (modes | empty | few))
    return pl.select(pl.when(taken).then(words)).to_series()


def _are_words(words: pl.Series) -> NDArray[np.bool_]:
    numbers = words.str.replace(",", ".", literal=True).cast(pl.Float64, strict=False).is_not_null()
    nothing = words.str.to_lowercase().is_in(list(NO_WORD))
    return (~(numbers | nothing)).fill_null(False).to_numpy()


def _begin_with_a_number(words: pl.Series) -> NDArray[np.bool_]:
    return words.str.contains(r"^[<>=~≤≥+-]*\s*\d").fill_null(False).to_numpy()
