"""What saturation, quantisation and holding leave in a window."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.features.window import PER_CYCLE, ShapeWindow
from app.engine.recording import FloatArray
from app.engine.signals.sampled import ROUNDING, deviation, moving_average, peak_to_peak, quantile, without_line

_SAME_STEP = 0.02
_FEWEST_STEPS = 10


@dataclass(frozen=True)
class Limits:
    """Marks of limits and of the instrument.

    op_at_limit: share of the window that OP stands at one of its extremes.
    pv_moves_at_limit: share of the PV movement that happens meanwhile.
    pv_quantum: least step of PV in standard deviations, where nearly all its steps are multiples of it; else 0.
    pv_least_step: log10 of the 5 % quantile of the non-zero steps of PV in standard deviations.
    pv_held, op_held: share of samples equal to the one before.
    """

    op_at_limit: float
    pv_moves_at_limit: float
    pv_quantum: float
    pv_least_step: float
    pv_held: float
    op_held: float


def limits(window: ShapeWindow) -> Limits:
    """The features of `Limits` for one window."""
    return Limits(*_limits(window.even_pv, window.even_op, window.raw_pv, window.raw_op))


@njit(cache=True, nogil=True)
def _limits(pv: FloatArray, op: FloatArray, raw_pv: FloatArray, raw_op: FloatArray) -> tuple[float, ...]:
    """What `Limits` has, in its order."""
    at_limit, moves_at_limit = _at_limits(op, moving_average(pv, 2))
    pv_steps, op_steps = _steps(raw_pv), _steps(raw_op)
    moved = pv_steps[pv_steps > ROUNDING]
    return (
        at_limit,
        moves_at_limit,
        _quantum(moved),
        math.log10(_low_quantile(moved) + 1e-3) if len(moved) else 0.0,
        1.0 - len(moved) / len(pv_steps),
        1.0 - np.count_nonzero(op_steps > ROUNDING) / len(op_steps),
    )


@njit(cache=True, nogil=True)
def _steps(x: FloatArray) -> FloatArray:
    """Steps between samples in standard deviations of x less its straight line; zeros where that leaves rounding."""
    steps, spread = np.zeros(len(x) - 1), deviation(without_line(x))
    if spread > ROUNDING * peak_to_peak(x):
        for i in range(len(steps)):
            steps[i] = abs(x[i + 1] - x[i]) / spread
    return steps


@njit(cache=True, nogil=True)
def _at_limits(op: FloatArray, pv: FloatArray) -> tuple[float, float]:
    """Of the end of its range at which OP is more, the share of samples; of the end at which PV moves more, the share
    of that movement. op: (n,); pv: (n,) smoothed.
    """
    band, apart = 5e-3 * peak_to_peak(op), PER_CYCLE // 10
    bottom, top = op.min() + band, op.max() - band
    at, moved, whole = np.zeros(2), np.zeros(2), 0.0
    for i in range(len(op)):
        at[0] += op[i] <= bottom
        at[1] += op[i] >= top
        if i < apart:
            continue
        movement, before = abs(pv[i] - pv[i - apart]), op[i - apart]
        whole += movement
        moved[0] += movement if op[i] <= bottom and before <= bottom else 0.0
        moved[1] += movement if op[i] >= top and before >= top else 0.0
    return at.max() / len(op), moved.max() / whole if whole > 0.0 else 0.0


@njit(cache=True, nogil=True)
def _quantum(steps: FloatArray) -> float:
    if len(steps) < _FEWEST_STEPS:
        return 0.0
    whole, least = 0, steps.min()
    for step in steps:
        multiple = step / least
        whole += abs(multiple - np.round(multiple)) < _SAME_STEP
    return least if whole / len(steps) > 0.95 else 0.0


@njit(cache=True, nogil=True)
def _low_quantile(steps: FloatArray) -> float:
    """The 5 % quantile of steps (n,), n at least 1: it lies between two of them, and no others need their order."""
    below = int(0.05 * (len(steps) - 1))
    return quantile(np.partition(steps, np.array([below, min(below + 1, len(steps) - 1)])), 0.05)
