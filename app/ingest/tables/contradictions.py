"""Rows that contradict others of their tag and time, wherever in the file these stand: where they are many, a column
that is not read may tell the two apart, as plants that have the same tags."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.ingest.model import FloatArray, TimeArray
from app.nanoseconds import NS_PER_DAY, NS_PER_H

MANY, MANY_SHARE = 10, 0.2  # pairs of rows at least, in so many of the rows of their tags: corrections are fewer
_APART = 1e-3  # of a signal's range: two historians round the same value otherwise
_OF_ALL_TAGS = 0.01  # of the rows of all tags, where one alone was corrected throughout
_OF_REPEATS = 0.25  # of the rows whose time comes again: most of those that were sent twice are the same
_WEEK, _THURSDAY, _SATURDAY = 7, 3, 5  # days; 1970 began on a Thursday
MOST_HELD = 1 << 16  # pairs, which tell as much as all

Lines = NDArray[np.integer[Any]]


@dataclass
class Contradictions:
    """Those that were met. rows: of all tags; of those that have some there are counted their rows, and those of a
    time that came before."""

    rows: int = 0
    rows_of_tags: int = 0
    repeats: int = 0
    pairs: int = 0
    _span_ns: tuple[int, int] | None = None
    _held: list[NDArray[np.int64]] = field(default_factory=list)
    _told: int = 0  # pairs, when they were last asked for

    def look(self, time_ns: TimeArray, matrix: FloatArray, lines: Lines, columns: Sequence[int] = (0,)) -> None:
        """time_ns (n,) in order, rows of one time as they came; columns of matrix (n, m): what may contradict."""
        again = np.flatnonzero(time_ns[1:] == time_ns[:-1])
        if not len(again):
            return
        asked = np.asarray(columns, dtype=np.int64)
        earlier, later = matrix[np.ix_(again, asked)], matrix[np.ix_(again + 1, asked)]
        both = np.isfinite(earlier) & np.isfinite(later)
        with np.errstate(invalid="ignore"):
            apart = np.abs(earlier - later) > _APART * _ranges(matrix[:, asked])
        at = again[np.any(both & apart, axis=1)]
        if not len(at):
            return
        self.rows_of_tags += len(time_ns)
        self.repeats += int(np.count_nonzero(both.any(axis=1)))
        self.pairs += len(at)
        self._span_ns = _joined(self._span_ns, time_ns[at])
        room = max(MOST_HELD - sum(held.shape[1] for held in self._held), 0)
        at = at[:: -(-len(at) // room)] if room else at[:0]
        self._held.append(np.stack((lines[at], lines[at + 1])).astype(np.int64))

    def of_other_columns(self) -> "Contradictions":
        """To go on with other columns of the same rows, none of which has contradicted another one yet."""
        return Contradictions(self.rows, _told=self._told)

    def lines_to_ask(self) -> NDArray[np.int64] | None:
        """(2, k) the lines of rows, and of those that contradict them; None where they are few, or hardly more than
        when they were last asked for."""
        shares = MANY_SHARE * self.rows_of_tags, _OF_ALL_TAGS * self.rows, _OF_REPEATS * self.repeats
        if self.pairs < max(MANY, *shares, 2 * self._told) or self._are_of_hour_of_autumn():
            return None
        self._told = self.pairs
        return np.concatenate(self._held, axis=1)

    def _are_of_hour_of_autumn(self) -> bool:
        """Whether all lie in one hour of a weekend, as that which clocks put back have twice."""
        if self._span_ns is None:
            return False
        first, last = self._span_ns
        return first // NS_PER_H == last // NS_PER_H and (first // NS_PER_DAY + _THURSDAY) % _WEEK >= _SATURDAY


def _ranges(matrix: FloatArray) -> FloatArray:
    """(m,) of the columns of matrix (n, m); 0 where there is no value."""
    finite = np.isfinite(matrix)
    low, high = np.where(finite, matrix, np.inf).min(axis=0), np.where(finite, matrix, -np.inf).max(axis=0)
    return np.where(high > low, high - low, 0.0)


def _joined(span: tuple[int, int] | None, time_ns: TimeArray) -> tuple[int, int]:
    """time_ns: in order."""
    first, last = int(time_ns[0]), int(time_ns[-1])
    return (first, last) if span is None else (min(first, span[0]), max(last, span[1]))
