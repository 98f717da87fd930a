"""How wide the band of a historian is that kept only some samples of PV: the deviation of its swinging door, or by how
much PV has to move before another value is kept.

Where three scans in a row were kept, the door shut on the first line that it was asked for, so that the middle one is
farther off the line between its neighbours than the width; a move that was kept is larger than its band. The least of
such sizes is an upper bound, and how thickly they lie above it tells how far below it the width is: their distances are
exponential, as those of Renyi 1953, doi 10.1007/BF02127580, are. Where scans in a row are hardly ever kept, because the
door is far wider than the noise, only the distances of all kept samples from the line between their neighbours tell
it, and that roughly: their median was 0.4 to 4 times the width in simulated loops, the more the less noise PV has and
the less it wanders. Where PV was not stored at even times, or was bridged, they tell no bound.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from app.engine.recording import FloatArray, IntArray

_NEAREST, _LEAST_IN_A_ROW = 10, 4
_LEAST_KEPT = 20  # samples: fewer say no more than that PV did not go much farther than the width
_SURE = 0.95
_ROUGHLY = (0.2, 0.74, 4.5)  # times the median: the lowest width, the likeliest and the highest
_STRAY = 0.8  # of what all but 2 % of moves pass: less is kept for the time that went by
_WHOLE = 0.95  # of the distances between kept samples are whole scans


@dataclass(frozen=True)
class Width:
    """A width with its 95 % interval, unit of PV."""

    value: float
    low: float
    high: float


def unbounded(width: Width, pv: FloatArray) -> Width:
    """The same width with no bounds but the range of PV (N,)."""
    return Width(width.value, 0.0, max(float(np.ptp(pv)), width.value))


def below(sizes: FloatArray) -> Width:
    """The width below all of some sizes (M,), three or more, that come as near to it as chance allows."""
    least = np.sort(sizes)[:_NEAREST]
    apart, first = float(np.mean(np.diff(least))), float(least[0])
    reach = float(fdtri(2.0, 2.0 * (len(least) - 1.0), _SURE)) * apart
    return Width(max(first - apart, 0.0), max(first - reach, 0.0), first)


def band_of(moves: FloatArray) -> Width:
    """The band of a historian that keeps what moved: of its kept moves (M,) in their order, not zero."""
    moves = moves[:-1] if len(moves) > 1 else moves  # the last sample of a record is kept whatever it is
    usual = float(np.quantile(moves, 0.02))
    beyond = moves[moves > _STRAY * usual]
    return below(beyond) if len(beyond) > _LEAST_IN_A_ROW else Width(usual, 0.0, usual)


def door_of(pv: FloatArray, kept: IntArray) -> Width:
    """The width of a swinging door of which the samples `kept` (K,) of PV (N,) are left."""
    before, after = np.diff(kept[:-1]), np.diff(kept[1:-1], append=kept[-1])
    slopes = np.diff(pv[kept]) / np.diff(kept)
    off = np.abs(np.diff(slopes)) * before * after / (before + after)
    # As the last sample is kept whatever it is, nothing is off for it.
    off, before, after = off[:-1], before[:-1], after[:-1]
    if len(off) < _LEAST_KEPT:
        wide = float(np.ptp(pv))  # of what is left of PV: of all of it, a part of twice the width is gone
        return Width(min(float(np.median(np.append(off, wide))), wide), 0.0, 2.0 * wide)
    low, likeliest, high = (times * float(np.median(off)) for times in _ROUGHLY)
    row = off[(before == after) & (before == scan_of(np.diff(kept)))]
    if len(row) >= _LEAST_IN_A_ROW:
        width = below(row)
        if low < width.value < high:
            return width
    elif len(row) and np.min(row) > low:
        high = min(high, float(np.min(row)))
    return Width(min(likeliest, high), low, high)


def scan_of(apart: IntArray) -> int:
    """The longest interval, in samples, of which the distances (M,) between kept samples are multiples."""
    for scan in range(int(np.quantile(apart, 0.2)), 1, -1):
        if np.mean(apart % scan == 0) > _WHOLE:
            return scan
    return 1
