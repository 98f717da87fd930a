"""How much of one signal follows from another through a lag and a dead time, in free run and on cycles not fitted."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.features import PER_CYCLE
from app.engine.freerun import INTEGRATOR, through_process, valve_position
from app.engine.recording import FloatArray
from app.engine.sampled import dot, without_drift

_LAGS = (0.0, 0.04, 0.1, 0.25, 0.6, INTEGRATOR)
_DEAD_TIMES = (0.0, 0.03, 0.07, 0.13, 0.22)
_DRIFT_HALF = int(1.5 * PER_CYCLE)
_WORST = -1.0
_STANDS = 1e-9


@dataclass(frozen=True)
class Response:
    """fit: share of the variance that the best model explains where it was fitted; held_out: on the other half."""

    fit: float
    held_out: float


def response(y: FloatArray, x: FloatArray) -> Response:
    """The best first-order lag or integrator with dead time from x to y, (n,) each at PER_CYCLE samples a cycle.

    The same models, drift removal and halves as `freerun`; only the gain is regressed, of either sign. Nothing follows
    from an x that does not move.
    """
    spread = float(np.std(x))
    if spread <= _STANDS * float(np.max(np.abs(x))):
        return Response(0.0, 0.0)
    lags = PER_CYCLE * np.array(_LAGS)
    dead_times = np.round(np.array(_DEAD_TIMES) * PER_CYCLE).astype(np.int64)
    fit, held_out = _best(without_drift(y, _DRIFT_HALF), x / spread, lags, dead_times, _DRIFT_HALF)
    return Response(float(fit), float(held_out))


def valve_response(pv: FloatArray, op: FloatArray, bands: tuple[float, ...], slips: tuple[float, ...]) -> Response:
    """The same from OP (in units of its range in a cycle) to PV behind He's valve, the best of S in bands, J / S in
    slips."""
    found = [response(pv, valve_position(op, S, S * slip)) for S in bands for slip in slips]
    return max(found, key=lambda r: r.fit)


@njit(cache=True, nogil=True)
def _best(y, x, lags, dead_times, drift):  # type: ignore[no-untyped-def]
    """Fit and held-out share of the model that fits best over both halves."""
    n, half = len(y), len(y) // 2
    best, held = -1.0, 0.0
    xy, xx, yy = np.zeros(2), np.zeros(2), np.zeros(2)
    for lag in lags:
        z = without_drift(through_process(x, lag), drift)
        for theta in dead_times:
            for part in range(2):
                first, last = (theta, half) if part == 0 else (half, n)
                late, there = z[first - theta : last - theta], y[first:last]
                xy[part], xx[part], yy[part] = dot(late, there), dot(late, late), dot(there, there)
            fit = xy.sum() ** 2 / (xx.sum() + 1e-12) / (yy.sum() + 1e-300)
            if fit > best:
                best, held = fit, 0.0
                for part in range(2):
                    other = 1 - part
                    gain = xy[part] / (xx[part] + 1e-12)
                    left = yy[other] - 2.0 * gain * xy[other] + gain**2 * xx[other]
                    held += 0.5 * max(1.0 - left / (yy[other] + 1e-300), _WORST)
    return best, held
