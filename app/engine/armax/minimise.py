"""Prediction-error minimisation, compiled: Levenberg and Marquardt's steps from a good start."""

import numpy as np
from numba import njit

from app.engine.armax.gram import LAST, NOW, lagged_dot, lagged_dots, solve_least_squares
from app.engine.armax.kernel import COLLINEAR, filtered_gram
from app.engine.armax.predict import SLOWEST_ROOT, filter_by_c, is_stable, prediction_errors
from app.engine.recording import FloatArray
from app.engine.signals.sampled import sum_of_squares

LARGEST_DAMPING = 1e8
TOLERANCE = 1e-9


@njit(cache=True, nogil=True)
def _gradient(
    y: FloatArray, v: FloatArray, errors: FloatArray, adjoint: FloatArray, orders: tuple, gram: FloatArray
) -> None:
    """The exact half gradient of the sum of squares, into the last column of `gram`.

    adjoint: (N,) the errors that are counted, filtered by 1/C backwards in time. One such filter serves all
    coefficients: each derivative is then a lagged dot product from the first error on. With the lags of the forward
    filtered signals the start of the record would be slightly wrong, and the steps would stall where C is slow.
    """
    na, nb, nc = orders
    start, target = max(na, nb), na + nb + nc
    lagged_dots(adjoint, y, NOW, LAST, start, gram[:na, target])
    lagged_dots(adjoint, v, NOW, LAST, start, gram[na : na + nb, target])
    for k in range(nc):
        gram[na + nb + k, target] = lagged_dot(errors, adjoint, k + 1, NOW, max(start, k + 1))


@njit(cache=True, nogil=True)
def _damped_step(gram: FloatArray, damping: float, room: FloatArray, step: FloatArray) -> None:
    size = gram.shape[0]
    room[:size] = gram
    for k in range(size - 1):
        room[k, k] *= 1.0 + damping
    solve_least_squares(room, size, COLLINEAR, room[size], step)


@njit(cache=True, nogil=True)
def minimise(
    y: FloatArray,
    v: FloatArray,
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    errors: FloatArray,
    first: int,
    steps: int,
    tolerance: float,
) -> tuple:
    """Improves a, b, c and their one-step errors (N,) in place.

    Returns (sum of squares over first..N-1, steps taken, whether it converged). C must be stable at the start. A step
    that would raise the sum of squares or make C unstable is damped and taken again.
    """
    na, nb, nc = len(a), len(b), len(c)
    size = na + nb + nc + 1
    gram, room, step = np.zeros((size, size)), np.zeros((size + 1, size)), np.zeros(size)
    signals, filtered = np.zeros((4, len(y))), np.empty((4, len(y)))
    signals[0], signals[1] = y, v
    trial_errors = np.empty(len(y))
    trial_a, trial_b, trial_c = a.copy(), b.copy(), c.copy()
    best = sum_of_squares(errors, first)
    damping = 0.0
    for taken in range(steps):
        signals[2], signals[3, : len(y) - first] = errors, errors[::-1][: len(y) - first]
        filter_by_c(signals, c, filtered)
        filtered_gram(filtered, (na, nb, nc), first, gram)
        _gradient(y, v, errors, filtered[3, ::-1].copy(), (na, nb, nc), gram)
        while True:
            _damped_step(gram, damping, room, step)
            trial_a[:] = a - step[:na]
            trial_b[:] = b + step[na : na + nb]
            trial_c[:] = c + step[na + nb : na + nb + nc]
            trial = np.inf
            if is_stable(trial_c, SLOWEST_ROOT):
                prediction_errors(y, v, trial_a, trial_b, trial_c, trial_errors)
                trial = sum_of_squares(trial_errors, first)
            if trial < best:
                break
            damping = max(10.0 * damping, 1e-3)
            if damping > LARGEST_DAMPING:
                return best, taken, True
        gain = best - trial
        a[:], b[:], c[:], errors[:] = trial_a, trial_b, trial_c, trial_errors
        best = trial
        damping = 0.1 * damping if damping > 1e-6 else 0.0
        if gain <= tolerance * best:
            return best, taken + 1, True
    return best, steps, False
