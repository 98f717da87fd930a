"""A limit of a valve or of a sensor, its corner sharp or rounded over a width."""

from collections.abc import Callable

import numpy as np
from numba import njit

from app.engine.mismatch.loop.block import Context
from app.engine.recording import BoolArray, FloatArray

_STRAIGHT = 40.0  # so many widths from the corner nothing of it is left: exp(-40) is less than rounding


def limited_at(sign: float) -> Callable[[FloatArray, FloatArray, Context], FloatArray]:
    """What lets a signal (N,) go no farther up (down, for sign -1) than its first value, the corner rounded over its
    second, in unit of the signal, where it has one.
    """

    def apply(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
        if len(values) > 1:
            return rounded(signal, values[0], values[1], sign)
        return sign * np.minimum(sign * signal, sign * values[0])

    return apply


def beyond_limit(sign: float) -> Callable[[FloatArray, FloatArray, Context], BoolArray]:
    """Where a signal (N,) wants to go farther than that."""

    def active(signal: FloatArray, values: FloatArray, _: Context) -> BoolArray:
        return sign * signal > sign * values[0]

    return active


def rounded(signal: FloatArray, limit: float, width: float, sign: float) -> FloatArray:
    """signal below `limit` (above, for sign -1), the corner rounded over `width`."""
    return _rounded(np.ascontiguousarray(signal), float(limit), float(width), sign)


@njit(cache=True, nogil=True)
def _rounded(signal: FloatArray, limit: float, width: float, sign: float) -> FloatArray:
    out = np.empty(len(signal))
    for t in range(len(signal)):
        under = sign * (limit - signal[t]) / width
        corner = np.log1p(np.exp(-abs(under))) if abs(under) < _STRAIGHT else 0.0
        out[t] = limit - sign * width * (max(under, 0.0) + corner)
    return out
