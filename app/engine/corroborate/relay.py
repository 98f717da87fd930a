"""Rossi and Scali's relay: half cycles of PV fitted by the response to a relay, against sine and triangle."""

import numpy as np
from numba import njit

from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features import ShapeWindow
from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray

METHOD = Method("relay", "10.1016/j.jprocont.2004.11.003", sticky_from=0.21, healthy_to=0.0)
_LAGS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
_FEWEST_HALF_CYCLE = 8


def relay(windows: list[ShapeWindow], oscillation: Oscillation) -> Corroboration:
    """(E_sine - E_relay) / (E_sine + E_relay), E_relay the better of relay and triangle; for regular oscillations.

    The relay's response is that of a first-order process to a square wave, its lag free between 2 and 80 % of the half
    cycle.
    """
    if not oscillation.regular:
        return METHOD.refuse("the loop does not oscillate regularly")
    indices = [relay_index(window.pv_smooth) for window in windows]
    return METHOD.answer(float(np.mean(indices)), "relay and triangle against sine on PV")


@njit(cache=True, nogil=True)
def relay_index(x: FloatArray) -> float:
    """The index over the half cycles of x (n,), weighted by their energy; 0 where none is long enough."""
    total = weight = 0.0
    start = -1
    for i in range(1, len(x)):
        if (x[i] >= 0.0) == (x[i - 1] >= 0.0):
            continue
        if start >= 0 and i - start >= _FEWEST_HALF_CYCLE:
            half = np.abs(x[start:i])
            energy = np.sum(half * half)
            total += energy * _half_cycle(half)
            weight += energy
        start = i
    return total / weight if weight > 0.0 else 0.0


@njit(cache=True, nogil=True)
def _half_cycle(half: FloatArray) -> float:
    t = (np.arange(len(half)) + 0.5) / len(half)
    sine = _misfit(half, np.sin(np.pi * t))
    other = _misfit(half, np.minimum(t, 1.0 - t))
    for k in range(len(_LAGS)):
        lag = _LAGS[k]
        # A first-order response to a relay that starts at zero and comes back to zero at the end of the half cycle.
        rise = 1.0 - 2.0 * np.exp(-t / lag) / (1.0 + np.exp(-1.0 / lag))
        other = min(other, _misfit(half, np.maximum(rise, 0.0)))
        other = min(other, _misfit(half, np.maximum(rise[::-1], 0.0)))
    return (sine - other) / (sine + other + 1e-12)


@njit(cache=True, nogil=True)
def _misfit(half: FloatArray, form: FloatArray) -> float:
    square = np.sum(form * form)
    gain = np.sum(half * form) / square if square > 0.0 else 0.0
    return np.sum((half - gain * form) ** 2)
