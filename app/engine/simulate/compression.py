"""What a historian does to a signal before it is exported: exception reporting and swinging-door compression."""

from typing import Literal

import numpy as np
from numba import njit

from app.engine.recording import BoolArray, FloatArray

Compression = Literal["exception", "swinging_door"]


def keep(time_s: FloatArray, value: FloatArray, deviation: float, kind: Compression) -> BoolArray:
    """(N,) True at the samples that the historian stores; the first and the last are always stored.

    time_s: (N,) s, increasing. value: (N,) finite. deviation: band in the unit of value, not negative; 0 stores every
    change ("exception") or every change of slope ("swinging_door").
    "exception" stores a sample that is more than `deviation` away from the last stored one. "swinging_door" stores the
    last sample before a straight line from the stored one can no longer pass within `deviation` of all samples since.
    Source of the latter: E. H. Bristol, Swinging door trending, ISA 1990; US patent 4,669,097.
    """
    kernel = _exception if kind == "exception" else _swinging_door
    return kernel(np.ascontiguousarray(time_s, np.float64), np.ascontiguousarray(value, np.float64), float(deviation))


def rebuild(time_s: FloatArray, value: FloatArray, kept: BoolArray, kind: Compression) -> FloatArray:
    """(N,) what an export at time_s gives back: stored samples held ("exception") or joined by straight lines."""
    if kind == "swinging_door":
        return np.interp(time_s, time_s[kept], value[kept])
    last = np.maximum.accumulate(np.where(kept, np.arange(len(kept)), 0))
    return value[last].astype(np.float64)


@njit(cache=True, fastmath=False, nogil=True)
def _exception(time_s: FloatArray, value: FloatArray, deviation: float) -> BoolArray:
    kept = np.zeros(value.size, dtype=np.bool_)
    if value.size == 0:
        return kept
    kept[0] = kept[-1] = True
    last = value[0]
    for k in range(1, value.size):
        if abs(value[k] - last) > deviation:
            kept[k] = True
            last = value[k]
    return kept


@njit(cache=True, fastmath=False, nogil=True)
def _swinging_door(time_s: FloatArray, value: FloatArray, deviation: float) -> BoolArray:
    kept = np.zeros(value.size, dtype=np.bool_)
    if value.size == 0:
        return kept
    kept[0] = kept[-1] = True
    pivot = 0
    upper, lower = np.inf, -np.inf
    for k in range(1, value.size):
        span = time_s[k] - time_s[pivot]
        slope = (value[k] - value[pivot]) / span
        if slope > upper or slope < lower:
            pivot = k - 1
            kept[pivot] = True
            span = time_s[k] - time_s[pivot]
            upper, lower = np.inf, -np.inf
        upper = min(upper, (value[k] + deviation - value[pivot]) / span)
        lower = max(lower, (value[k] - deviation - value[pivot]) / span)
    return kept
