"""The coloured noise of a loop: what is left of PV once the simulation is taken off, and how it is whitened.

H(q) = (1 - z1 q^-1)(1 - z2 q^-1) / ((1 - p1 q^-1)(1 - p2 q^-1)), poles and zeros real: sums of two first-order
disturbances and white measurement noise have this form. Complex poles are left out on purpose: they would take in an
oscillation as noise. Where that is asked for, an autoregression of the innovations stands beside it (`further`).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numba import njit
from scipy.linalg import solve_toeplitz

from app.engine.recording import BoolArray, FloatArray
from app.engine.signals.sampled import REORDERED_SUMS, sum_of_squares

POLE_MAX = 0.9995
_ZERO_MAX = 0.97
Four = tuple[float, float, float, float]
_LONG_GAP = 4
_SAMPLES_A_LAG = 20
RIDGE = 1e-9
_SETTLING, _SHARE_OF_SETTLING = 3, 20
_FIRST_STEPS, _LAST_STEPS, _PURSUED = 8, 17, 2
_STARTS = (
    (0.95, 0.0, 0.4, 0.0),
    (0.98, 0.8, 0.85, 0.0),
    (0.995, 0.5, 0.9, 0.0),
    (0.6, 0.0, 0.0, 0.0),
    (0.998, 0.93, 0.6, 0.2),
    (0.97, 0.93, 0.7, 0.3),
)


@dataclass(frozen=True)
class NoiseModel:
    """Poles and zeros of H, and the standard deviation of the innovations in the unit of PV. further: weights of the
    innovations before, by which those of H foretell themselves.
    """

    poles: tuple[float, float] = (0.0, 0.0)
    zeros: tuple[float, float] = (0.0, 0.0)
    deviation: float = 1.0
    further: tuple[float, ...] = ()

    @cached_property
    def shape(self) -> FloatArray:
        return np.array([*self.poles, *self.zeros])

    @cached_property
    def numbers(self) -> FloatArray:
        """The shape and the deviation, as the kernels read them."""
        return np.array([*self.poles, *self.zeros, self.deviation])

    @cached_property
    def weights(self) -> FloatArray:
        return np.array(self.further, dtype=np.float64)


@njit(cache=True, nogil=True)
def _coefficients(shape: FloatArray) -> Four:
    return -(shape[0] + shape[1]), shape[0] * shape[1], -(shape[2] + shape[3]), shape[2] * shape[3]


@njit(cache=True, nogil=True)
def _next(r: float, seen: bool, anew: bool, coefficients: Four, before: Four) -> Four:
    """This residual and the last, this innovation and the last, after such four of the sample before.

    A residual that is not seen is replaced by its prediction, so that its innovation is zero. After a gap the
    disturbance is elsewhere: the first sample is where it starts anew, no innovation.
    """
    a1, a2, c1, c2 = coefficients
    r1, r2, e1, e2 = before
    known = a1 * r1 + a2 * r2 - c2 * e2  # the newest innovation last: nothing else is waited for
    if not seen:
        return c1 * e1 - known, r1, 0.0, e1
    if anew:
        return r, r, 0.0, e1
    return r, r1, (r + known) - c1 * e1, e1


@njit(cache=True, nogil=True)
def _whiten(r: FloatArray, usable: BoolArray, shape: FloatArray, e: FloatArray) -> None:
    """Innovations of r into e; where r is not usable it is replaced by its prediction, so that e is zero there."""
    coefficients, state, hidden = _coefficients(shape), (0.0, 0.0, 0.0, 0.0), 0
    for t in range(len(r)):
        seen = usable[t]
        state = _next(r[t], seen, seen and hidden >= _LONG_GAP, coefficients, state)
        e[t] = state[2]
        hidden = 0 if seen else hidden + 1


@njit(cache=True, nogil=True)
def _whiten_twice(r: FloatArray, usable: BoolArray, shapes: FloatArray, e: FloatArray) -> None:
    """`_whiten` under two shapes (2, 4), into e (2, N): in the time of one, because neither waits for the other."""
    first, second = _coefficients(shapes[0]), _coefficients(shapes[1])
    one = other = (0.0, 0.0, 0.0, 0.0)
    hidden = 0
    for t in range(len(r)):
        seen = usable[t]
        anew = seen and hidden >= _LONG_GAP
        one, other = _next(r[t], seen, anew, first, one), _next(r[t], seen, anew, second, other)
        e[0, t], e[1, t] = one[2], other[2]
        hidden = 0 if seen else hidden + 1


@njit(cache=True, nogil=True)
def compared_samples(usable: BoolArray) -> BoolArray:
    """(N,) True where `whiten` finds an innovation: not where PV is unknown, nor where it starts anew after a gap."""
    compared = usable.copy()
    hidden = 0
    for t in range(len(usable)):
        compared[t] = usable[t] and hidden < _LONG_GAP
        hidden = 0 if usable[t] else hidden + 1
    return compared


@njit(cache=True, nogil=True)
def _less_foretold(e: FloatArray, compared: BoolArray, weights: FloatArray) -> None:
    """Takes off innovations (N,) what those before foretell of them by weights (M,), in place."""
    for t in range(len(e) - 1, 0, -1):
        if compared[t]:
            foretold = 0.0
            for k in range(min(len(weights), t)):
                foretold += weights[k] * e[t - 1 - k]
            e[t] -= foretold


@njit(cache=True, nogil=True)
def _limit(shape: FloatArray) -> None:
    for k in range(4):
        low, high = (-0.5, POLE_MAX) if k < 2 else (-0.9, _ZERO_MAX)
        shape[k] = min(max(shape[k], low), high)


@njit(cache=True, nogil=True)
def _cost(r: FloatArray, usable: BoolArray, shape: FloatArray, e: FloatArray, skip: int) -> float:
    _whiten(r, usable, shape, e)
    return sum_of_squares(e, skip)


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def _products(e: FloatArray, moved: FloatArray, skip: int) -> FloatArray:
    """(4, 5) inner products of the differences from e (N,) of four rows (4, N) with each other, and with e."""
    aa = ab = ac = ad = bb = bc = bd = cc = cd = dd = 0.0
    ae = be = ce = de = 0.0
    first, second, third, fourth = moved[0], moved[1], moved[2], moved[3]
    for t in range(skip, len(e)):
        now = e[t]
        a, b, c, d = now - first[t], now - second[t], now - third[t], now - fourth[t]
        aa, ab, ac, ad, ae = aa + a * a, ab + a * b, ac + a * c, ad + a * d, ae + a * now
        bb, bc, bd, be = bb + b * b, bc + b * c, bd + b * d, be + b * now
        cc, cd, ce = cc + c * c, cd + c * d, ce + c * now
        dd, de = dd + d * d, de + d * now
    return np.array([[aa, ab, ac, ad, ae], [ab, bb, bc, bd, be], [ac, bc, cc, cd, ce], [ad, bd, cd, dd, de]])


@njit(cache=True, nogil=True)
def _minimise(r: FloatArray, usable: BoolArray, shape: FloatArray, skip: int, steps: int) -> float:
    """Levenberg-Marquardt on the four poles and zeros, in place; returns the sum of squares."""
    n = len(r)
    e, there = np.empty(n), np.empty(n)
    moved, back, trials = np.empty((4, n)), np.empty(4), np.empty((4, 4))
    damping = 1e-3
    _limit(shape)
    cost = _cost(r, usable, shape, e, skip)
    for _ in range(steps):
        for k in range(4):
            back[k] = 1e-4 if shape[k] < 0.9 else 0.02 * (1.0 - shape[k]) + 1e-6
            trials[k] = shape
            trials[k, k] -= back[k]
        _whiten_twice(r, usable, trials[:2], moved[:2])
        _whiten_twice(r, usable, trials[2:], moved[2:])
        products = _products(e, moved, skip)
        normal, gradient = products[:, :4] / np.outer(back, back), products[:, 4] / back
        better = False
        for _ in range(6):
            lifted = normal.copy()
            for k in range(4):
                lifted[k, k] += damping * (normal[k, k] + 1e-9 * cost) + 1e-300
            trial = shape - np.linalg.solve(lifted, gradient)
            _limit(trial)
            cost_there = _cost(r, usable, trial, there, skip)
            if cost_there < cost:
                better = cost - cost_there > 1e-5 * cost
                cost = cost_there
                shape[:] = trial
                e, there = there, e
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
    if noise.further:
        _less_foretold(e, compared_samples(usable), noise.weights)
    return e


@njit(cache=True, nogil=True)
def _scaled_innovations(
    pv: FloatArray,
    simulated: FloatArray,
    usable: BoolArray,
    numbers: FloatArray,
    weights: FloatArray,
    less: FloatArray,
    rows: FloatArray,
) -> None:
    """Innovations of pv (N,) less simulations (L, N), over their deviation and less a row, into the beginnings of rows;
    the first are left out. numbers: the noise's shape and deviation. weights: its further ones.
    """
    n, deviation = len(pv), numbers[4]
    compared = compared_samples(usable) if len(weights) else usable
    skip = min(_SETTLING, n // _SHARE_OF_SETTLING)
    r, e = np.empty(n), np.empty(n)
    for k in range(len(simulated)):
        there, row, kept = simulated[k], rows[k], e[skip:]
        for t in range(n):
            r[t] = pv[t] - there[t]
        _whiten(r, usable, numbers, e)
        if len(weights):
            _less_foretold(e, compared, weights)
        for t in range(n - skip):
            row[t] = kept[t] / deviation - less[t]


def scaled_innovations(
    pv: FloatArray, simulated: FloatArray, usable: BoolArray, noise: NoiseModel, less: FloatArray, rows: FloatArray
) -> None:
    """Writes the innovations of pv (N,) less simulations (L, N) over their deviation, less a row (N or more,), into the
    rows (L, N or more), without those that `settling_samples` counts.
    """
    _scaled_innovations(pv, np.ascontiguousarray(simulated), usable, noise.numbers, noise.weights, less, rows)


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
    e = scipy.signal.lfilter([1.0], [1.0, *-noise.weights], e) if noise.further else e
    return _colour(np.ascontiguousarray(e, dtype=np.float64), noise.shape)


def settling_samples(n: int) -> int:
    """How many innovations at the start are left out, because the filter does not know what was before the record."""
    return min(_SETTLING, n // _SHARE_OF_SETTLING)


def compared_count(usable: BoolArray) -> int:
    """n of every log-likelihood: how many innovations there are where PV is `usable` (N,), without those that
    `settling_samples` counts. An innovation that is zero by construction says nothing, and counts for nothing.
    """
    return int(np.sum(compared_samples(usable)[settling_samples(len(usable)) :]))


def fit_noise(r: FloatArray, usable: BoolArray, start: NoiseModel | None = None, further: int = 0) -> NoiseModel:
    """The noise model of the residual r (N,) by least squares of its innovations over the samples compared.

    From a `start` only that one is refined; without, several starts are tried, because slow noise under white noise
    has two optima. further: so many lags of an autoregression of the innovations beside it.
    Source of the form: Box, Jenkins, Reinsel, Ljung, Time Series Analysis, doi 10.1002/9781118619193, chapter 3.
    """
    r = np.ascontiguousarray(r, dtype=np.float64)
    found = _fit_poles_and_zeros(r, usable, start)
    return _with_further(r, usable, found, further) if further else found


def _with_further(r: FloatArray, usable: BoolArray, found: NoiseModel, lags: int) -> NoiseModel:
    """A noise model with so many lags of an autoregression of its innovations beside it, fewer where there are few
    samples.
    """
    lags = min(lags, compared_count(usable) // _SAMPLES_A_LAG)
    e = np.empty(len(r))
    _whiten(r, usable, found.shape, e)
    covariances = autocovariances(e[settling_samples(len(r)) :], lags)
    if lags == 0 or not covariances[0] > 0.0:
        return found
    richer = replace(found, further=tuple(autoregression(covariances).tolist()))
    cost = sum_of_squares(whiten(r, usable, richer), settling_samples(len(r)))
    return _model_of(found.shape, cost, compared_count(usable), richer.further)


def autoregression(covariances: FloatArray) -> FloatArray:
    """Weights (M,) of the samples before by which a series, not all zero, foretells itself best, from the sums
    (M + 1,) of `autocovariances`, by the equations of Yule and Walker. Source: Box, Jenkins, Reinsel, Ljung,
    doi 10.1002/9781118619193, chapter 3.
    """
    return np.asarray(solve_toeplitz(covariances[:-1], covariances[1:]), dtype=np.float64)


def autocovariances(series: FloatArray, order: int) -> FloatArray:
    """(order + 1,) sums of products at the lags 0 to order, the first a trifle larger, as a ridge."""
    sums = np.array([series[lag:] @ series[: len(series) - lag] for lag in range(order + 1)])
    sums[0] *= 1.0 + RIDGE
    return sums


def _fit_poles_and_zeros(r: FloatArray, usable: BoolArray, start: NoiseModel | None) -> NoiseModel:
    """As `fit_noise`, without any autoregression."""
    skip, count = settling_samples(len(r)), compared_count(usable)
    if start is not None:
        shape = np.array(start.shape)
        return _model_of(shape, _minimise(r, usable, shape, skip, _FIRST_STEPS), count)
    shapes = [np.array(candidate) for candidate in _STARTS]
    tried = [(_minimise(r, usable, shape, skip, _FIRST_STEPS), k) for k, shape in enumerate(shapes)]
    best, best_cost = np.zeros(4), np.inf
    for _, k in sorted(tried)[:_PURSUED]:
        cost = _minimise(r, usable, shapes[k], skip, _LAST_STEPS)
        if cost < best_cost:
            best, best_cost = shapes[k], cost
    return _model_of(best, best_cost, count)


def _model_of(shape: FloatArray, cost: float, count: int, further: tuple[float, ...] = ()) -> NoiseModel:
    """The model of a shape whose innovations, so many, have this sum of squares."""
    p1, p2, z1, z2 = shape.tolist()
    return NoiseModel((p1, p2), (z1, z2), float(np.sqrt(max(cost, 1e-300) / max(count, 1))), further)
