"""The order search over a whole valve grid, compiled: one valve position after another, each to the end."""

import numpy as np
from numba import njit

from app.engine.armax.gram import LAST, NOW, fill_lagged_gram, fill_own_gram
from app.engine.armax.kernel import (
    criterion_value,
    efficient_gram,
    least,
    long_autoregression,
    regression_gram,
    solve_order,
    sweep_orders,
    sweep_rooms,
)
from app.engine.armax.minimise import TOLERANCE, minimise
from app.engine.armax.predict import prediction_errors
from app.engine.recording import FloatArray


@njit(cache=True, nogil=True)
def search_grid(
    y: FloatArray,
    v: FloatArray,
    means: FloatArray,
    orders: tuple,
    nc_min: int,
    fixed: tuple,
    stages: int,
    p: int,
    logarithmic: bool,
    steps: int,
    chosen: np.ndarray,
    figures: FloatArray,
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
) -> None:
    """The whole search: chosen (M, 3) orders, figures (M, 2) with AIC and RMSE, and coefficients, all in place.

    y: (N,) deviations from the mean. v: (M, N) valve positions, deviations from means (M,) are taken. fixed: an order
    to take instead of the least AIC, or (0, 0, 0). steps: of prediction-error minimisation that each chosen model
    takes. Every order of every valve position is judged over the same samples, p + nc..N-1.
    """
    na, nb, nc = orders
    size = na + nb + nc + 1
    first = p + nc
    samples = len(y) - first
    yy, yv, vv = np.zeros((p + 1, p + 1)), np.empty((p + 1, p)), np.zeros((p, p))
    gram, room = np.zeros((size, size)), np.zeros((3, size, size))
    long_room = np.empty((2 * p + 3, 2 * p + 1))
    rooms, residuals = sweep_rooms(orders), np.empty((na, nb, nc + 1))
    errors = np.empty(len(y))
    best = (1, 1, nc_min)
    fill_own_gram(yy, NOW, y, (NOW, p + 1), first)
    for m in range(v.shape[0]):
        stem = v[m] - means[m]
        fill_lagged_gram(yv, NOW, NOW, y, stem, (NOW, p + 1, LAST, p), first)
        fill_own_gram(vv, NOW, stem, (LAST, p), first)
        long_autoregression(y, stem, yy, yv, vv, long_room, errors)
        regression_gram(y, stem, errors, yy, yv, vv, orders, first, gram)
        for stage in range(2, stages + 1):
            if stage == 3:
                efficient_gram(y, stem, errors, c[m, : best[2]], orders, first, gram)
            sweep_orders(gram, orders, rooms, residuals)
            best = fixed if fixed[0] > 0 else least(residuals, samples, logarithmic, nc_min)
            solve_order(gram, orders, best, room, a[m], b[m], c[m])
            model = a[m, : best[0]], b[m, : best[1]], c[m, : best[2]]
            prediction_errors(y, stem, *model, errors)
        chosen[m] = best
        residual = residuals[best[0] - 1, best[1] - 1, best[2]]
        figures[m, 0] = criterion_value(residual, samples, best[0] + best[1] + best[2], logarithmic)
        total, _, _ = minimise(y, stem, *model, errors, first, steps, TOLERANCE)
        figures[m, 1] = np.sqrt(total / samples)
