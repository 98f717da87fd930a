"""Whether PV stands still while OP travels: what a stuck valve looks like from outside."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numba import njit

from app.engine.features.window import CYCLES, PER_CYCLE, ShapeWindow, cycle_samples, window_of
from app.engine.oscillation import Oscillation
from app.engine.recording import BoolArray, FloatArray, IntArray, UniformRecord
from app.engine.signals.movement_patterns import rho_3
from app.engine.signals.sampled import (
    ROUNDING,
    burstiness,
    correlation,
    deviation,
    median,
    peak_to_peak,
    piece_ranges,
    quantile,
)

REVERSAL = 0.7
_STILL_BAND = 0.3
_EIGHTH = PER_CYCLE // 8
_FEWEST_LEG_SAMPLES = 4
_FEWEST_SAMPLES = 16
_STRIDE = PER_CYCLE // 10


@dataclass(frozen=True)
class Travel:
    """Travel of OP and PV against each other.

    flat_eighth, flat_quarter: share of the OP travel made in eighths (quarters) of a cycle in which PV moves less than
    0.3 of the range that it covers in its liveliest ones.
    pv_moves_alone: share of the PV range covered in eighths of a cycle in which OP hardly travels.
    together_eighth, together_quarter: correlation of OP travel and PV range over these pieces.
    leg_still: of an OP leg between two reversals, the largest share travelled while PV keeps within a narrow band;
    the median of the legs.
    leg_sharpness: share of its range that PV covers in the quickest quarter of a leg; median.
    leg_spread: how much leg_still differs between legs.
    leg_contrast: difference of mean PV between rising and falling legs.
    pv_bursts, op_bursts: share of all movement that the liveliest fifth of the time holds.
    sticking, sticking_fine: Yamashita's rho_3, PV standing while OP moves and then following it, at ten and at twenty
    steps a cycle.
    """

    flat_eighth: float
    flat_quarter: float
    pv_moves_alone: float
    together_eighth: float
    together_quarter: float
    leg_still: float
    leg_sharpness: float
    leg_spread: float
    leg_contrast: float
    pv_bursts: float
    op_bursts: float
    sticking: float
    sticking_fine: float


def travel(window: ShapeWindow) -> Travel:
    """The features of `Travel` for one window."""
    return Travel(*_travels(window.pv_smooth, window.op_smooth, window.pv_slope, window.op_slope))


@njit(cache=True, nogil=True)
def _travels(pv: FloatArray, op: FloatArray, dpv: FloatArray, dop: FloatArray) -> tuple[float, ...]:
    """What `Travel` has, in its order, of smoothed signals (n,) and their slopes."""
    op_eighth, pv_eighth = _pieces(pv, op, _EIGHTH)
    op_quarter, pv_quarter = _pieces(pv, op, PER_CYCLE // 4)
    spread = deviation(pv)
    legs = _legs(pv, op, REVERSAL * deviation(op), _STILL_BAND * spread)
    some = len(legs) >= 2
    return (
        _flat_share(op_eighth, pv_eighth),
        _flat_share(op_quarter, pv_quarter),
        _share(pv_eighth, op_eighth < 0.15),
        correlation(op_eighth, pv_eighth),
        correlation(op_quarter, pv_quarter),
        median(legs[:, 0]) if some else 0.0,
        median(legs[:, 1]) if some else 0.0,
        deviation(legs[:, 0]) if some else 0.0,
        _contrast(legs, spread),
        burstiness(dpv),
        burstiness(dop),
        rho_3(op[::_STRIDE], pv[::_STRIDE]),
        rho_3(op[:: _STRIDE // 2], pv[:: _STRIDE // 2]),
    )


def standing(pv: FloatArray, op: FloatArray, per_cycle: float) -> BoolArray:
    """(N,) where OP travels and PV stands: of the eighths of a cycle that `flat_eighth` counts those in which OP does
    travel, by the same measure, as a picture marks them.

    pv, op: (N,) of an even record, finite, `per_cycle` samples a cycle. They are looked at by some fifteen cycles at a
    time, as the features look at them; nothing is marked where PV or OP does not vary.
    """
    n = len(pv)
    edges = np.linspace(0, n, max(1, round(n / (CYCLES * per_cycle))) + 1).astype(int)
    return np.concatenate([_standing(pv[a:b], op[a:b], per_cycle) for a, b in pairwise(edges)])


def standing_as_sampled(time_s: FloatArray, pv: FloatArray, op: FloatArray, oscillation: Oscillation) -> BoolArray:
    """(N,) as `standing`, of samples as they came: on an even grid at their median interval, each sample by the point
    next to it.

    time_s: (N,) s, increasing. pv, op: (N,) finite. oscillation: of the loop then, however often it was
    stored. Nothing is marked of fewer than 16 samples.
    """
    if len(time_s) < _FEWEST_SAMPLES:
        return np.zeros(len(time_s), np.bool_)
    since = time_s - time_s[0]
    interval = float(np.median(np.diff(since)))
    grid = np.arange(0.0, since[-1] + 0.5 * interval, interval)
    on_grid = np.interp(grid, since, pv), np.interp(grid, since, op)
    even = UniformRecord(interval, *on_grid, None, np.zeros(len(grid), np.bool_))
    per_cycle = None if oscillation.period_s is None else oscillation.period_s / interval
    marked = standing(even.pv, even.op, cycle_samples(even, replace(oscillation, samples_per_cycle=per_cycle)))
    nearest: BoolArray = marked[np.minimum(np.rint(since / interval).astype(np.int64), len(grid) - 1)]
    return nearest


def _standing(pv: FloatArray, op: FloatArray, per_cycle: float) -> BoolArray:
    window = window_of(pv, op, per_cycle)
    if window is None:
        return np.zeros(len(pv), np.bool_)
    op_travel, pv_range = _pieces(window.pv_smooth, window.op_smooth, _EIGHTH)
    found = _flat(pv_range) & ~_flat(op_travel)
    piece = np.arange(len(pv)) * len(window.pv) // (len(pv) * _EIGHTH)
    return np.append(found, False)[np.minimum(piece, len(found))]  # what is left over after the last piece is not told


@njit(cache=True, nogil=True)
def _pieces(pv: FloatArray, op: FloatArray, size: int) -> tuple[FloatArray, FloatArray]:
    """Net OP travel and PV range, (n // size,) each, of the pieces of `size` samples."""
    travels = np.empty(len(op) // size)
    for k in range(len(travels)):
        travels[k] = abs(op[(k + 1) * size - 1] - op[k * size])
    return travels, piece_ranges(pv, size)


@njit(cache=True, nogil=True)
def _flat_share(op_travel: FloatArray, pv_range: FloatArray) -> float:
    return _share(op_travel, _flat(pv_range))


@njit(cache=True, nogil=True)
def _flat(moved: FloatArray) -> BoolArray:
    return moved < 0.3 * quantile(np.sort(moved), 0.9)


@njit(cache=True, nogil=True)
def _share(amount: FloatArray, where: BoolArray) -> float:
    total, there = amount.sum(), 0.0
    for k in range(len(amount)):
        there += amount[k] if where[k] else 0.0
    return there / total if total > 0.0 else 0.0


@njit(cache=True, nogil=True)
def _contrast(legs: FloatArray, spread: float) -> float:
    levels, counts = np.zeros(2), np.zeros(2)
    for k in range(len(legs)):
        falling = 1 if legs[k, 3] < 0 else 0
        levels[falling] += legs[k, 2]
        counts[falling] += 1.0
    if counts.min() == 0.0 or spread <= 0.0:
        return 0.0
    return abs(levels[0] / counts[0] - levels[1] / counts[1]) / spread


@njit(cache=True, nogil=True)
def _legs(pv: FloatArray, op: FloatArray, reversal: float, band: float) -> FloatArray:
    """(L, 4) for each OP leg between reversals: share travelled with PV still, sharpness, mean PV, direction."""
    turns = reversals(op, reversal)
    rows = np.empty((len(turns), 4))
    count = 0
    for k in range(len(turns) - 1):
        a, b = turns[k], turns[k + 1]
        whole = abs(op[b] - op[a])
        if b - a < _FEWEST_LEG_SAMPLES or whole <= 0.0:
            continue
        leg = pv[a : b + 1]
        rows[count, 0] = _still_travel(leg, op[a : b + 1], band) / whole
        rows[count, 1] = _quickest_quarter(leg)
        rows[count, 2] = leg.mean()
        rows[count, 3] = 1.0 if op[b] > op[a] else -1.0
        count += 1
    return rows[:count]


@njit(cache=True, nogil=True)
def reversals(x: FloatArray, reversal: float) -> IntArray:
    """Indices of the extremes of x (at unit deviation) from which it comes back by more than `reversal`."""
    turns = np.empty(len(x) + 1, dtype=np.int64)
    first, direction = _first_turn(x, reversal)
    if direction == 0.0:
        return turns[:0]
    turns[0] = first
    count, extreme = 1, first
    for i in range(first + 1, len(x)):
        # On a plateau the first sample counts, whatever rounding does to the others.
        if direction * (x[i] - x[extreme]) > ROUNDING:
            extreme = i
        elif direction * (x[extreme] - x[i]) > reversal:
            turns[count] = extreme
            count += 1
            direction, extreme = -direction, i
    return turns[:count]


@njit(cache=True, nogil=True)
def _first_turn(x: FloatArray, reversal: float) -> tuple[int, float]:
    """Where x first leaves an extreme by more than `reversal`, and in which direction; 0.0 where it never does."""
    lowest = highest = 0
    for i in range(1, len(x)):
        if x[i] < x[lowest] - ROUNDING:
            lowest = i
        if x[i] > x[highest] + ROUNDING:
            highest = i
        if x[i] - x[lowest] > reversal:
            return lowest, 1.0
        if x[highest] - x[i] > reversal:
            return highest, -1.0
    return 0, 0.0


@njit(cache=True, nogil=True)
def _still_travel(pv: FloatArray, op: FloatArray, band: float) -> float:
    """Largest OP travel over consecutive samples whose PV stays within `band`."""
    best, first, low, high = 0.0, 0, pv[0], pv[0]
    for i in range(len(pv)):
        low, high = min(low, pv[i]), max(high, pv[i])
        if high - low > band:
            first, low, high = i, pv[i], pv[i]
            while max(high, pv[first - 1]) - min(low, pv[first - 1]) <= band:
                first -= 1
                low, high = min(low, pv[first]), max(high, pv[first])
        best = max(best, abs(op[i] - op[0]) - abs(op[first] - op[0]))
    return best


@njit(cache=True, nogil=True)
def _quickest_quarter(pv: FloatArray) -> float:
    n = len(pv)
    step = max(1, n // 4)
    whole = peak_to_peak(pv)
    if whole <= ROUNDING or n <= step:
        return 1.0
    most = 0.0
    for i in range(n - step):
        most = max(most, abs(pv[i + step] - pv[i]))
    return most / whole
