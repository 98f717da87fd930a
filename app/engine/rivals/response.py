"""How much of one signal follows from another through a lag and a dead time, in free run and on cycles not fitted."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.features import PER_CYCLE
from app.engine.freerun import fill_sums, process_grid, valve_position
from app.engine.recording import FloatArray
from app.engine.signals.sampled import deviation, dot, without_drift

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

    Models, drift removal and halves are those of `freerun`; only the gain is regressed, with either sign. Nothing
    follows from an x that does not move.
    """
    spread = float(deviation(x))
    if spread <= _STANDS * float(np.max(np.abs(x))):
        return Response(0.0, 0.0)
    fit, held_out = _best(without_drift(y, _DRIFT_HALF), x / spread, *process_grid(PER_CYCLE), _DRIFT_HALF)
    return Response(float(fit), float(held_out))


def valve_response(pv: FloatArray, op: FloatArray, bands: tuple[float, ...], slips: tuple[float, ...]) -> Response:
    """The same from OP (in units of its range in a cycle) to PV behind He's valve, for the best S in `bands` and J / S
    in `slips`.
    """
    found = [response(pv, valve_position(op, S, S * slip)) for S in bands for slip in slips]
    return max(found, key=lambda r: r.fit)


@njit(cache=True, nogil=True)
def _best(y, x, lags, dead_times, drift):  # type: ignore[no-untyped-def]
    """Fit and held-out share of the model that fits best over both halves."""
    half = len(y) // 2
    best, held = -1.0, 0.0
    yy, sums_xy = np.zeros(2), np.zeros((len(lags), len(dead_times), 2))
    sums_xx = np.zeros_like(sums_xy)
    fill_sums(y, x, (lags, dead_times), drift, sums_xy, sums_xx)
    yy[1] = dot(y[half:], y[half:])
    for i in range(len(lags)):
        for k in range(len(dead_times)):
            xy, xx, first = sums_xy[i, k], sums_xx[i, k], y[dead_times[k] : half]
            yy[0] = dot(first, first)  # of what a dead time leaves to be foretold
            fit = xy.sum() ** 2 / (xx.sum() + 1e-12) / (yy.sum() + 1e-300)
            if fit > best:
                best, held = fit, 0.0
                for part in range(2):
                    other = 1 - part
                    gain = xy[part] / (xx[part] + 1e-12)
                    left = yy[other] - 2.0 * gain * xy[other] + gain**2 * xx[other]
                    held += 0.5 * max(1.0 - left / (yy[other] + 1e-300), _WORST)
    return best, held
