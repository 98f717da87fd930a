"""What tells by how much a signal has turned, and on which side it is: stems and relays of many sizes."""

import numpy as np
from numba import njit

from app.engine.recording import FloatArray
from app.engine.signals.sampled import quantiles
from app.engine.valve import kano_stems

_RANGE = (0.01, 0.99)

TURN = 0.1
"""A signal has turned where it went back by this share of its standard deviation: less is noise."""


def usual_range(x: FloatArray) -> float:
    """Of nearly all samples."""
    low, high = quantiles(x, _RANGE)
    return float(high - low)


def stems(x: FloatArray, sizes: FloatArray, jump: float) -> FloatArray:
    """(M, N): where Kano's valves have their stems when a signal (N,) moves them, over its usual range. sizes: S of
    each, (M,), over that range. jump: J over S. The sign of the signal is free: a valve at rest knows one direction,
    and x first moves in it.
    """
    first = float(np.sign(x[np.argmax(x != x[0])] - x[0]))
    out = np.empty((len(sizes), len(x)))
    kano_stems((x - x[0]) * (first / usual_range(x)), sizes, jump * sizes, out)
    return out


def relays(x: FloatArray, sizes: FloatArray) -> FloatArray:
    """(M, N): 1 since a signal was last above half of each of these sizes (M,) over its usual range, -1 since it was
    last below minus that, 0 before it was either.
    """
    sides: FloatArray = _last_sides(x, 0.5 * usual_range(x) * sizes)
    return sides


@njit(cache=True, nogil=True)
def _last_sides(x: FloatArray, beyond: FloatArray) -> FloatArray:
    sides = np.empty((len(beyond), len(x)))
    for m in range(len(beyond)):
        side = 0.0
        for t in range(len(x)):
            if abs(x[t]) > beyond[m]:
                side = 1.0 if x[t] > 0.0 else -1.0
            sides[m, t] = side
    return sides


def since_reversal(x: FloatArray) -> FloatArray:
    """(N,) how far a signal x (N,), N at least 1, has gone since it last turned, signed by its direction; in the unit
    of x.
    """
    threshold = TURN * float(np.std(x))
    turned, extreme, direction = float(x[0]), float(x[0]), 0.0
    travel = np.zeros(len(x))
    for k, value in enumerate(x.tolist()):
        if direction * (extreme - value) > threshold or (direction == 0.0 and abs(value - extreme) > threshold):
            turned, direction, extreme = extreme, float(np.sign(value - extreme)), value
        elif direction * (value - extreme) > 0.0:
            extreme = value
        travel[k] = value - turned
    return travel
