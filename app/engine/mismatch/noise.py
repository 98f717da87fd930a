"""The coloured noise of a loop: what is left of PV once the simulation is taken off, and how it is whitened.

H(q) = (1 - z1 q^-1)(1 - z2 q^-1) / ((1 - p1 q^-1)(1 - p2 q^-1)), poles and zeros real: sums of two first-order
disturbances
and white measurement noise have this form. Complex poles are left out on purpose: they would take in an oscillation as
noise.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.recording import BoolArray, FloatArray

POLE_MAX = 0.9995
ZERO_MAX = 0.97
LONG_GAP = 4
FIRST_STEPS, LAST_STEPS, PURSUED = 8, 17, 2
STARTS = (
    (0.95, 0.0, 0.4, 0.0),
    (0.98, 0.8, 0.85, 0.0),
    (0.995, 0.5, 0.9, 0.0),
    (0.6, 0.0, 0.0, 0.0),
    (0.998, 0.93, 0.6, 0.2),
    (0.97, 0.93, 0.7, 0.3),
)


@dataclass(frozen=True)
class NoiseModel:
    """Poles and zeros of H, and the standard deviation of the innovations in the unit of PV."""

    poles: tuple[float, float] = (0.0, 0.0)
    zeros: tuple[float, float] = (0.0, 0.0)
    deviation: float = 1.0

    @property
    def shape(self) -> FloatArray:
        return np.array([*self.poles, *self.zeros])


@njit(cache=True, nogil=True)
def _whiten(r: FloatArray, usable: BoolArray, shape: FloatArray, e: FloatArray) -> None:
    """Innovations of r into e; where r is not usable it is replaced by its prediction, so that e is zero there."""
    a1, a2 = -(shape[0] + shape[1]), shape[0] * shape[1]
    c1, c2 = -(shape[2] + shape[3]), shape[2] * shape[3]
    r1 = r2 = e1 = e2 = 0.0
    hidden = 0
    for t in range(len(r)):
        predicted = -a1 * r1 - a2 * r2 + c1 * e1 + c2 * e2
        now = r[t] if usable[t] else predicted
        e[t] = now - predicted
        if not usable[t]:
            hidden += 1
        else:
            # After a gap the disturbance is elsewhere: the first sample is where it starts anew, no innovation.
            if hidden >= LONG_GAP:
                e[t] = 0.0
                r1 = now
            hidden = 0
        r2, r1, e2, e1 = r1, now, e1, e[t]


@njit(cache=True, nogil=True)
def compared_samples(usable: BoolArray) -> BoolArray:
    """(N,) True where `whiten` finds an innovation: not where PV is unknown, nor where it starts anew after a gap."""
    compared = usable.copy()
    hidden = 0
    for t in range(len(usable)):
        compared[t] = usable[t] and hidden < LONG_GAP
        hidden = 0 if usable[t] else hidden + 1
    return compared


@njit(cache=True, nogil=True)
def _limit(shape: FloatArray) -> None:
    for k in range(4):
        low, high = (-0.5, POLE_MAX) if k < 2 else (-0.9, ZERO_MAX)
        shape[k] = min(max(shape[k], low), high)


@njit(cache=True, nogil=True)
def _cost(r: FloatArray, usable: BoolArray, shape: FloatArray, e: FloatArray, skip: int) -> float:
    _whiten(r, usable, shape, e)
    total = 0.0
    for t in range(skip, len(e)):
        total += e[t] * e[t]
    return total


@njit(cache=True, nogil=True)
def _minimise(r: FloatArray, usable: BoolArray, shape: FloatArray, skip: int, steps: int) -> float:
    """Levenberg-Marquardt on the four poles and zeros, in place; returns the sum of squares."""
    n = len(r)
    e, moved = np.empty(n), np.empty(n)
    slopes = np.empty((4, n))
    damping = 1e-3
    _limit(shape)
    cost = _cost(r, usable, shape, e, skip)
    for _ in range(steps):
        for k in range(4):
            trial = shape.copy()
            h = 1e-4 if trial[k] < 0.9 else 0.02 * (1.0 - trial[k]) + 1e-6
            trial[k] -= h
            _whiten(r, usable, trial, moved)
            slopes[k] = (e - moved) / h
        kept = np.ascontiguousarray(slopes[:, skip:])
        normal = kept @ kept.T.copy()
        gradient = kept @ e[skip:]
        better = False
        for _ in range(6):
            lifted = normal.copy()
            for k in range(4):
                lifted[k, k] += damping * (normal[k, k] + 1e-9 * cost) + 1e-300
            trial = shape - np.linalg.solve(lifted, gradient)
            _limit(trial)
            cost_there = _cost(r, usable, trial, moved, skip)
            if cost_there < cost:
                better = cost - cost_there > 1e-5 * cost
                cost = cost_there
                shape[:] = trial
                e[:] = moved
                damping = max(0.2 * damping, 1e-7)
                break
            damping *= 8.0
        if not better:
            break
    return cost


def whiten(r: FloatArray, usable: BoolArray, noise: NoiseModel) -> FloatArray:
    """Innovations (N,) of the residual r (N,) under a noise model; zero where `usable` (N,) is False."""
    e = np.empty(len(r))
    _whiten(np.ascontiguousarray(r), usable, noise.shape, e)
    return e


@njit(cache=True, nogil=True)
def _colour(e: FloatArray, shape: FloatArray) -> FloatArray:
    a1, a2 = -(shape[0] + shape[1]), shape[0] * shape[1]
    c1, c2 = -(shape[2] + shape[3]), shape[2] * shape[3]
    r = np.zeros(len(e))
    for t in range(len(e)):
        r[t] = e[t]
        if t > 0:
            r[t] += c1 * e[t - 1] - a1 * r[t - 1]
        if t > 1:
            r[t] += c2 * e[t - 2] - a2 * r[t - 2]
    return r


def coloured(e: FloatArray, noise: NoiseModel) -> FloatArray:
    """Noise (N,) made of innovations e (N,): what `whiten` undoes."""
    return _colour(np.ascontiguousarray(e, dtype=np.float64), noise.shape)


def settling_samples(n: int) -> int:
    """How many innovations at the start are left out, because the filter does not know what was before the record."""
    return min(3, n // 20)


def fit_noise(r: FloatArray, usable: BoolArray, start: NoiseModel | None = None) -> NoiseModel:
    """The noise model of the residual r (N,) by least squares of its innovations over the usable samples.

    From a `start` only that one is refined; without, several starts are tried, because slow noise under white noise
    has two optima.
    Source of the form: Box, Jenkins, Reinsel, Ljung, Time Series Analysis, doi 10.1002/9781118619193, chapter 3.
    """
    r = np.ascontiguousarray(r, dtype=np.float64)
    skip = settling_samples(len(r))
    if start is not None:
        shape = np.array(start.shape)
        return model_of(shape, _minimise(r, usable, shape, skip, FIRST_STEPS), usable[skip:])
    shapes = [np.array(candidate) for candidate in STARTS]
    tried = [(_minimise(r, usable, shape, skip, FIRST_STEPS), k) for k, shape in enumerate(shapes)]
    best, best_cost = np.zeros(4), np.inf
    for _, k in sorted(tried)[:PURSUED]:
        cost = _minimise(r, usable, shapes[k], skip, LAST_STEPS)
        if cost < best_cost:
            best, best_cost = shapes[k], cost
    return model_of(best, best_cost, usable[skip:])


def model_of(shape: FloatArray, cost: float, compared: BoolArray) -> NoiseModel:
    """The model of a shape whose innovations have this sum of squares over the samples compared."""
    p1, p2, z1, z2 = shape.tolist()
    count = max(int(np.sum(compared)), 1)
    return NoiseModel((p1, p2), (z1, z2), float(np.sqrt(max(cost, 1e-300) / count)))
