"""How much of a signal is a sine that keeps its phase: fitted on the first half, continued into the second."""

import numpy as np
from numba import njit

from app.engine.features import PER_CYCLE
from app.engine.recording import FloatArray
from app.engine.sampled import without_drift

_PERIODS = PER_CYCLE * np.linspace(0.96, 1.04, 13)
_DRIFT_HALF = int(1.5 * PER_CYCLE)


def held_out_sine(x: FloatArray) -> float:
    """Share of the variance of the second half of x (n,) that the sine fitted to its first half explains, at least 0.

    x at PER_CYCLE samples a cycle; its period is searched within 4 % on the whole, amplitude and phase on the half.
    """
    return max(float(_held_out(without_drift(x, _DRIFT_HALF), _PERIODS)), 0.0)


@njit(cache=True, nogil=True)
def _held_out(x, periods):  # type: ignore[no-untyped-def]
    half = len(x) // 2
    least, held = np.inf, -1.0
    for period in periods:
        step = 2.0 * np.pi / period
        a, b = _sine(x, 0, len(x), step)
        left = _left(x, 0, len(x), step, a, b)
        if left < least:
            least = left
            a, b = _sine(x, 0, half, step)
            held = 1.0 - _left(x, half, len(x), step, a, b)
    return held


@njit(cache=True, nogil=True)
def _sine(x, first, last, step):  # type: ignore[no-untyped-def]
    """Least-squares amplitudes of sine and cosine over x[first:last]."""
    ss, cc, sc, xs, xc = 1e-9, 1e-9, 0.0, 0.0, 0.0
    for t in range(first, last):
        s, c = np.sin(step * t), np.cos(step * t)
        ss += s * s
        cc += c * c
        sc += s * c
        xs += x[t] * s
        xc += x[t] * c
    det = ss * cc - sc * sc
    return (xs * cc - xc * sc) / det, (xc * ss - xs * sc) / det


@njit(cache=True, nogil=True)
def _left(x, first, last, step, a, b):  # type: ignore[no-untyped-def]
    """Share of the variance of x[first:last] that the sine leaves over."""
    left, total = 0.0, 1e-300
    for t in range(first, last):
        error = x[t] - a * np.sin(step * t) - b * np.cos(step * t)
        left += error * error
        total += x[t] * x[t]
    return left / total
