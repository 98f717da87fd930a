"""How alike the legs of OP between its reversals are, and how alike PV answers along them."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.features.travel import REVERSAL, reversals
from app.engine.features.window import ShapeWindow
from app.engine.recording import FloatArray, IntArray
from app.engine.signals.sampled import burstiness, deviation, peak_to_peak, quantile, slope

_FEWEST_LEGS = 4
_BINS = 8
_UNKNOWN_SPREAD = 0.6


@dataclass(frozen=True)
class Legs:
    """A stuck valve lets go after the same travel of OP each time; a disturbance does not know the travel.

    leg_size_spread, leg_time_spread: standard deviation of the logarithms of travel and of duration of the legs of OP
    between two reversals.
    swing_spread: the same of the ranges of PV over these legs.
    path, path_slope: share of the variance of PV, and of its slope, that follows from the direction of OP and its
    travel since the last reversal.
    pv_corners, op_corners: share of the bending (movement of the slope) that the liveliest fifth of the time holds.
    """

    leg_size_spread: float
    leg_time_spread: float
    swing_spread: float
    path: float
    path_slope: float
    pv_corners: float
    op_corners: float


def legs(window: ShapeWindow) -> Legs:
    """The features of `Legs` for one window."""
    ends, travelled = _travelled(window.op_smooth)
    ordered = np.sort(travelled)  # NumPy's is several times as fast as a kernel's
    return Legs(*_alike(window.pv_smooth, window.op_smooth, window.pv_slope, window.op_slope, ends, travelled, ordered))


@njit(cache=True, nogil=True)
def _travelled(op: FloatArray) -> tuple[IntArray, FloatArray]:
    """Where OP turns, and its travel since the last turn at the samples between the first and the last one."""
    ends, place = reversals(op, REVERSAL * deviation(op)), 0
    travelled = np.empty(ends[-1] - ends[0] if len(ends) > 1 else 0)
    for k in range(len(ends) - 1):
        direction = np.sign(op[ends[k + 1]] - op[ends[k]])
        for i in range(ends[k], ends[k + 1]):
            travelled[place] = direction * (op[i] - op[ends[k]])
            place += 1
    return ends, travelled


@njit(cache=True, nogil=True)
def _alike(
    pv: FloatArray,
    op: FloatArray,
    dpv: FloatArray,
    dop: FloatArray,
    ends: IntArray,
    travelled: FloatArray,
    ordered: FloatArray,
) -> tuple[float, ...]:
    """What `Legs` has, in its order; ordered: travelled, sorted."""
    sizes, times = np.abs(_steps(op, ends)), np.empty(max(len(ends) - 1, 0))
    for k in range(len(times)):
        times[k] = ends[k + 1] - ends[k]
    path = path_slope = 0.0
    if len(sizes) >= _FEWEST_LEGS:
        edges = np.array([quantile(ordered, k / _BINS) for k in range(1, _BINS)])
        path = _between_bins(_along(pv, op, ends), travelled, edges)
        path_slope = _between_bins(_along(dpv, op, ends), travelled, edges)
    return (
        _spread(sizes),
        _spread(times),
        _spread(_ranges(pv, ends)),
        path,
        path_slope,
        burstiness(slope(dpv)),
        burstiness(slope(dop)),
    )


@njit(cache=True, nogil=True)
def _steps(x: FloatArray, ends: IntArray) -> FloatArray:
    """What x (n,) moves from each of the indices `ends` to the next."""
    steps = np.empty(max(len(ends) - 1, 0))
    for k in range(len(steps)):
        steps[k] = x[ends[k + 1]] - x[ends[k]]
    return steps


@njit(cache=True, nogil=True)
def _along(x: FloatArray, op: FloatArray, ends: IntArray) -> FloatArray:
    """x (n,) from the first to the last turn of OP, times the direction of OP then."""
    along, place = np.empty(ends[-1] - ends[0]), 0
    for k in range(len(ends) - 1):
        direction = np.sign(op[ends[k + 1]] - op[ends[k]])
        for i in range(ends[k], ends[k + 1]):
            along[place] = direction * x[i]
            place += 1
    return along


@njit(cache=True, nogil=True)
def _ranges(x: FloatArray, ends: IntArray) -> FloatArray:
    """Ranges of x (n,) between each of the indices `ends` and the next, both included."""
    ranges = np.empty(max(len(ends) - 1, 0))
    for k in range(len(ranges)):
        ranges[k] = peak_to_peak(x[ends[k] : ends[k + 1] + 1])
    return ranges


@njit(cache=True, nogil=True)
def _spread(x: FloatArray) -> float:
    if len(x) < _FEWEST_LEGS:
        return _UNKNOWN_SPREAD
    return deviation(np.log(np.maximum(x, 1e-3 * x.max() + 1e-12)))


@njit(cache=True, nogil=True)
def _between_bins(values: FloatArray, places: FloatArray, edges: FloatArray) -> float:
    """Share of the mean square of values (n,) that the means between the edges of their places hold; 0 where none."""
    count, sums = np.zeros(len(edges) + 1), np.zeros(len(edges) + 1)
    total = 0.0
    for i in range(len(values)):
        k = np.searchsorted(edges, places[i], side="right")
        count[k] += 1.0
        sums[k] += values[i]
        total += values[i] ** 2
    if total <= 0.0:
        return 0.0
    return np.sum(sums**2 / np.maximum(count, 1.0)) / total
