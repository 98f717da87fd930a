"""A limit with a rounded corner, of a valve or of a sensor."""

import numpy as np
from numba import njit

from app.engine.recording import FloatArray

STRAIGHT = 40.0  # so many widths from the corner nothing of it is left: exp(-40) is less than rounding


def rounded(signal: FloatArray, limit: float, width: float, sign: float) -> FloatArray:
    """signal below `limit` (above, for sign -1), the corner rounded over `width`."""
    return _rounded(np.ascontiguousarray(signal), float(limit), float(width), sign)


@njit(cache=True, nogil=True)
def _rounded(signal: FloatArray, limit: float, width: float, sign: float) -> FloatArray:
    out = np.empty(len(signal))
    for t in range(len(signal)):
        under = sign * (limit - signal[t]) / width
        corner = np.log1p(np.exp(-abs(under))) if abs(under) < STRAIGHT else 0.0
        out[t] = limit - sign * width * (max(under, 0.0) + corner)
    return out
