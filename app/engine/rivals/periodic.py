"""How much of a signal is a sine with a constant phase: fitted on the first half, continued into the second."""

import numpy as np
from numba import njit

from app.engine.features import PER_CYCLE
from app.engine.recording import FloatArray
from app.engine.signals.sampled import REORDERED_SUMS, without_drift

_PERIODS = PER_CYCLE * np.linspace(0.96, 1.04, 13)
_DRIFT_HALF = int(1.5 * PER_CYCLE)


def held_out_sine(x: FloatArray) -> float:
    """Share of the variance of the second half of x (n,) that the sine fitted to its first half explains, at least 0.

    x at PER_CYCLE samples a cycle; its period is searched within 4 % on the whole, amplitude and phase on the half.
    """
    return max(float(_held_out(without_drift(x, _DRIFT_HALF), _PERIODS)), 0.0)


@njit(cache=True, nogil=True)
def _held_out(x: FloatArray, periods: FloatArray) -> float:
    half = len(x) // 2
    sine, cosine = np.empty(len(x)), np.empty(len(x))
    least, held = np.inf, -1.0
    for period in periods:
        _fill_wave(2.0 * np.pi / period, sine, cosine)
        a, b = _amplitudes(x, sine, cosine)
        left = _left(x, sine, cosine, a, b)
        if left < least:
            least = left
            a, b = _amplitudes(x[:half], sine[:half], cosine[:half])
            held = 1.0 - _left(x[half:], sine[half:], cosine[half:], a, b)
    return held


@njit(cache=True, nogil=True)
def _fill_wave(step: float, sine: FloatArray, cosine: FloatArray) -> None:
    """sin(step t) and cos(step t), each sample the one before turned by `step`."""
    turn_sine, turn_cosine = np.sin(step), np.cos(step)
    s, c = 0.0, 1.0
    for t in range(len(sine)):
        sine[t], cosine[t] = s, c
        s, c = s * turn_cosine + c * turn_sine, c * turn_cosine - s * turn_sine


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def _amplitudes(x: FloatArray, sine: FloatArray, cosine: FloatArray) -> tuple[float, float]:
    """Least-squares amplitudes of sine and cosine over x."""
    ss, cc, sc, xs, xc = 1e-9, 1e-9, 0.0, 0.0, 0.0
    for t in range(len(x)):
        ss += sine[t] * sine[t]
        cc += cosine[t] * cosine[t]
        sc += sine[t] * cosine[t]
        xs += x[t] * sine[t]
        xc += x[t] * cosine[t]
    det = ss * cc - sc * sc
    return (xs * cc - xc * sc) / det, (xc * ss - xs * sc) / det


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def _left(x: FloatArray, sine: FloatArray, cosine: FloatArray, a: float, b: float) -> float:
    """Share of the variance of x that the wave leaves over."""
    left, total = 0.0, 1e-300
    for t in range(len(x)):
        error = x[t] - a * sine[t] - b * cosine[t]
        left += error * error
        total += x[t] * x[t]
    return left / total
