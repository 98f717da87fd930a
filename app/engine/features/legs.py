"""How alike the legs of OP between its reversals are, and how alike PV answers along them."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.features.travel import REVERSAL, reversals
from app.engine.features.window import ShapeWindow
from app.engine.recording import FloatArray, IntArray
from app.engine.signals.sampled import burstiness, deviation, peak_to_peak, quantiles, slope

_FEWEST_LEGS = 4
_BINS = 8
_EDGES = tuple(k / _BINS for k in range(1, _BINS))
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
    pv, op = window.pv_smooth, window.op_smooth
    dpv, dop = window.pv_slope, window.op_slope
    ends = reversals(op, REVERSAL * float(deviation(op)))
    sizes = np.abs(np.diff(op[ends]))
    swings = _ranges(pv, ends)
    way, travelled = _travelled(op, ends)
    between = slice(ends[0], ends[-1]) if len(sizes) >= _FEWEST_LEGS else None
    path, path_slope = (0.0, 0.0) if between is None else _paths(way * pv[between], way * dpv[between], travelled)
    return Legs(
        leg_size_spread=_spread(sizes),
        leg_time_spread=_spread(np.diff(ends).astype(np.float64)),
        swing_spread=_spread(swings),
        path=path,
        path_slope=path_slope,
        pv_corners=burstiness(slope(dpv)),
        op_corners=burstiness(slope(dop)),
    )


@njit(cache=True, nogil=True)
def _ranges(x: FloatArray, ends: IntArray) -> FloatArray:
    """Ranges of x (n,) between each of the indices `ends` and the next, both included."""
    ranges = np.empty(max(len(ends) - 1, 0))
    for k in range(len(ranges)):
        ranges[k] = peak_to_peak(x[ends[k] : ends[k + 1] + 1])
    return ranges


def _spread(x: FloatArray) -> float:
    if len(x) < _FEWEST_LEGS:
        return _UNKNOWN_SPREAD
    return float(_spread_of_logarithms(x))


@njit(cache=True, nogil=True)
def _spread_of_logarithms(x: FloatArray) -> float:
    return deviation(np.log(np.maximum(x, 1e-3 * x.max() + 1e-12)))


@njit(cache=True, nogil=True)
def _travelled(op: FloatArray, ends: IntArray) -> tuple[FloatArray, FloatArray]:
    """Direction (1 or -1) and travel since the last reversal of the samples between the first and the last turn."""
    between = ends[-1] - ends[0] if len(ends) > 1 else 0
    way, travelled, place = np.empty(between), np.empty(between), 0
    for k in range(len(ends) - 1):
        direction = np.sign(op[ends[k + 1]] - op[ends[k]])
        for i in range(ends[k], ends[k + 1]):
            way[place], travelled[place] = direction, direction * (op[i] - op[ends[k]])
            place += 1
    return way, travelled


def _paths(pv: FloatArray, pv_slope: FloatArray, travelled: FloatArray) -> tuple[float, float]:
    """Of PV and of its slope (n,), each along OP's legs, what bins of equal counts of travelled (n,) hold."""
    edges = quantiles(travelled, _EDGES)
    return float(_between_bins(pv, travelled, edges)), float(_between_bins(pv_slope, travelled, edges))


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
