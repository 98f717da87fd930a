"""Set points that move at the same times: of loops that swing together, what is asked before anything outside."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.engine.recording import FloatArray, IntArray
from app.nanoseconds import NS_PER_S

ALIKE = 0.7
"""Correlation of how far two set points move, bin by bin, from which they move together."""

FEWEST_MOVES = 3
"""In so many bins a set point has to move: two moves at one time may be chance."""

BIN_NS = 300 * NS_PER_S
FEWEST_BINS = 12


@dataclass(frozen=True, eq=False)
class Moves:
    """How far a set point moves in each bin of time, in parts of its range: far (B,), of bins of BIN_NS each, the
    first of which is number `first` since the epoch of its times.
    """

    first: int
    far: FloatArray


def together(moves: Sequence[Moves | None]) -> bool:
    """Whether the set points of at least half of these loops move at the times at which that of one of them does; None
    is one that is not known or stands, and counts as one of them.
    """
    moving = [one for one in moves if one is not None]
    counts = [sum(alike(one, other) for other in moving) for one in moving]
    return max(counts, default=0) >= max(2, (len(moves) + 1) // 2)


def alike(one: Moves, other: Moves) -> bool:
    """Whether two set points move at the same times, as far as both were recorded."""
    start = max(one.first, other.first)
    end = min(one.first + len(one.far), other.first + len(other.far))
    if end - start < FEWEST_BINS:
        return False
    first, second = (moves.far[start - moves.first : end - moves.first] for moves in (one, other))
    if min(np.count_nonzero(first), np.count_nonzero(second)) < FEWEST_MOVES:
        return False
    if min(np.ptp(first), np.ptp(second)) == 0.0:
        return False
    return float(np.corrcoef(first, second)[0, 1]) >= ALIKE


def moves_in(time_ns: IntArray, sp: FloatArray) -> Moves | None:
    """How far a set point sp (N,), NaN where it is not known, moves; None where it is not known, or stands.

    time_ns: (N,) ns on a clock that the compared loops share, increasing. Unit, offset and sign of sp change nothing.
    """
    known = np.isfinite(sp)
    if np.count_nonzero(known) < 2:
        return None
    bins = time_ns[known] // BIN_NS
    values = sp[known]
    size = np.ptp(values)
    if not (np.isfinite(size) and size > 0.0):
        return None
    far = np.zeros(int(bins[-1] - bins[0]) + 1)
    np.add.at(far, bins[1:] - bins[0], np.abs(np.diff(values)) / size)
    return Moves(int(bins[0]), far)
