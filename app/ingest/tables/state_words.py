"""Words of states that stand beside the numbers of a long table: which of them are the values."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.model import FloatArray
from app.ingest.numbers.no_data import NO_WORD
from app.ingest.tags.fault_words import tell_faults
from app.ingest.tags.modes import stand_for_no_data

_FEW = 0.5  # of a tag's rows
_MOVES = 3  # different numbers of a tag beside one word


def states_for_values(
    states: pl.Series,
    codes: NDArray[np.uint32],
    modes: NDArray[np.bool_],
    empty: NDArray[np.bool_],
    numbers: FloatArray,
) -> pl.Series:
    """(n,) the words that stand for the values of their rows, null elsewhere: those of modes, whose numbers count the
    states of a list that the file does not have; those beside which no number is; and those that a tag has in few
    rows, which say why it has no value, whatever number they have: none that begin with a number, as 1,059.4 t/h, nor
    alarms and remarks, beside which the numbers (n,) go on. codes: (n,) of the tags. empty: (n,) without a number."""
    words = states.cast(pl.String).str.strip_chars(' "')
    told = _are_words(words)
    rows, with_words = np.bincount(codes), np.bincount(codes, weights=told)
    few = told & (with_words < _FEW * rows)[codes] & ~_begin_with_a_number(words)
    why = few & ~_stand_beside_moving(words, codes, numbers, few & ~empty & ~modes)
    taken = pl.Series(told & (modes | empty | why))
    return pl.select(pl.when(taken).then(words)).to_series()


def _stand_beside_moving(
    words: pl.Series, codes: NDArray[np.uint32], numbers: FloatArray, asked: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(n,) whether the numbers of some tag move beside the word of a row: beside a state stands one of each, that of
    its code or the last good one. A word for no data, or for a fault, says so whatever stands beside it."""
    moving = np.zeros(len(words), dtype=bool)
    at = np.flatnonzero(asked & ~stand_for_no_data(words) & ~tell_faults(words).to_numpy())
    if len(at):
        told = pl.DataFrame({"tag": codes[at], "word": words[at], "number": numbers[at]})
        different = told.group_by("tag", "word").agg(pl.col("number").n_unique())
        moving[at] = words[at].is_in(different.filter(pl.col("number") >= _MOVES)["word"].to_list()).to_numpy()
    return moving


def _are_words(words: pl.Series) -> NDArray[np.bool_]:
    numbers = words.str.replace(",", ".", literal=True).cast(pl.Float64, strict=False).is_not_null()
    nothing = words.str.to_lowercase().is_in(list(NO_WORD))
    return (~(numbers | nothing)).fill_null(False).to_numpy()


def _begin_with_a_number(words: pl.Series) -> NDArray[np.bool_]:
    return words.str.contains(r"^[<>=~≤≥+-]*\s*\d").fill_null(False).to_numpy()
