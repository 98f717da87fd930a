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
_MOST_HELD = 1 << 18  # tags with a word and a number

Codes = NDArray[np.uint32]


class StateWords:
    """The words beside the numbers of each tag in a whole table, which tell what those of a row stand for: `see` rows
    before they are judged, and all of them where what came later makes those that were judged not settled. Tags are
    told by their codes."""

    def __init__(self) -> None:
        self._few_judged: set[tuple[int, bool]] = set()  # tags whose words were judged, and whether as few ones
        self._moving_judged: set[tuple[str, bool]] = set()
        self._rows, self._with_words = np.zeros(0), np.zeros(0)  # by code, how many
        self._beside = pl.DataFrame(schema={"tag": pl.UInt32, "word": pl.String, "number": pl.Float64})

    def see(self, states: pl.Series, codes: Codes, numbers: FloatArray) -> None:
        """(n,) of rows; numbers: NaN where none could be read."""
        given = np.flatnonzero(states.is_not_null().to_numpy())
        words = _stripped(states[given])
        told = _are_words(words)
        words, at = words.filter(pl.Series(told)), given[told]
        self._rows = _added(self._rows, np.bincount(codes))
        self._with_words = _added(self._with_words, np.bincount(codes[at], minlength=len(self._rows)))
        if len(at):
            more = pl.DataFrame({"tag": codes[at], "word": words, "number": numbers[at]})
            self._beside = _first_ones(pl.concat((self._beside, more.filter(pl.col("number").is_not_nan()))))

    @property
    def is_settled(self) -> bool:
        """Whether all rows together have each word judged as it was."""
        few = self._are_few()
        if len(self._moving_judged) >= _MOST_HELD or any(
            bool(few[code]) != judged for code, judged in self._few_judged
        ):
            return False
        words = pl.Series([word for word, _ in self._moving_judged], dtype=pl.String)
        moving = self._stand_beside_moving(words, np.ones(len(words), dtype=bool))
        return moving.tolist() == [judged for _, judged in self._moving_judged]

    def _are_few(self) -> NDArray[np.bool_]:
        """By code, of the words."""
        return np.asarray(self._with_words < _FEW * self._rows)

    def for_values(
        self, states: pl.Series, codes: Codes, modes: NDArray[np.bool_], empty: NDArray[np.bool_]
    ) -> pl.Series:
        """(n,) the words that stand for the values of their rows, null elsewhere: those of modes, whose numbers count
        the states of a list that the file does not have; those beside which no number is; and those that a tag has in
        few rows, which say why it has no value, whatever number they have: none that begin with a number, as 1,059.4
        t/h, nor alarms and remarks, beside which the numbers go on. empty: (n,) without a number."""
        given = np.flatnonzero(states.is_not_null().to_numpy())
        words, of_tag, empty, modes = _stripped(states[given]), codes[given], empty[given], modes[given]
        told = _are_words(words)
        asked = told & ~empty & ~modes & ~_begin_with_a_number(words)
        few = asked & self._are_few()[of_tag]
        moving = self._stand_beside_moving(words, few)
        self._note_judged(of_tag[asked], few[asked], words.filter(pl.Series(few)), moving[few])
        why = few & ~moving
        taken = told & (modes | empty | why)
        return pl.repeat(None, len(states), dtype=pl.String, eager=True).scatter(
            given[taken], words.filter(pl.Series(taken))
        )

    def _note_judged(self, of_tag: Codes, few: NDArray[np.bool_], words: pl.Series, moving: NDArray[np.bool_]) -> None:
        if len(self._moving_judged) >= _MOST_HELD:
            return
        self._few_judged |= set(pl.DataFrame({"tag": of_tag, "few": few}).unique().iter_rows())
        self._moving_judged |= set(pl.DataFrame({"word": words, "moving": moving}).unique().iter_rows())

    def _stand_beside_moving(self, words: pl.Series, asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(n,) whether the numbers of some tag move beside the word of a row: beside a state stands one of each, that
        of its code or the last good one. A word for no data, or for a fault, says so whatever stands beside it."""
        moving = np.zeros(len(words), dtype=bool)
        at = np.flatnonzero(asked & ~stand_for_no_data(words) & ~tell_faults(words).to_numpy())
        if len(at):
            of_few = pl.Series(self._are_few())[self._beside["tag"]]
            different = self._beside.filter(of_few).group_by("tag", "word").len()
            moving[at] = words[at].is_in(different.filter(pl.col("len") >= _MOVES)["word"].to_list()).to_numpy()
        return moving


def _added(counts: NDArray[np.float64], more: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.float64]:
    total = np.zeros(max(len(counts), len(more)))
    total[: len(counts)] += counts
    total[: len(more)] += more
    return total


def _first_ones(beside: pl.DataFrame) -> pl.DataFrame:
    """Of each tag and word as many different numbers as tell whether they move. Words that came once go where they are
    too many: remarks of which each is another one tell nothing."""
    different = beside.unique(maintain_order=True)
    first = different.filter(pl.int_range(pl.len()).over("tag", "word") < _MOVES)
    if first.height <= _MOST_HELD:
        return first
    return first.filter(pl.len().over("tag", "word") > 1).head(_MOST_HELD)


def _stripped(states: pl.Series) -> pl.Series:
    return states.cast(pl.String).str.strip_chars(' "')


def _are_words(words: pl.Series) -> NDArray[np.bool_]:
    numbers = words.str.replace(",", ".", literal=True).cast(pl.Float64, strict=False).is_not_null()
    nothing = words.str.to_lowercase().is_in(list(NO_WORD))
    return (~(numbers | nothing)).fill_null(False).to_numpy()


def _begin_with_a_number(words: pl.Series) -> NDArray[np.bool_]:
    return words.str.contains(r"^[<>=~≤≥+-]*\s*\d").fill_null(False).to_numpy()
