"""Hannan and Rissanen's order search, compiled: one Gram matrix a valve position, all orders from nested factors."""

import numpy as np
from numba import njit

from app.engine.armax.gram import (
    add_lagged,
    eliminate,
    eliminate_abreast,
    fill_lagged_gram,
    fill_own_gram,
    lagged_dot,
    lagged_dots,
    solve_least_squares,
)
from app.engine.armax.predict import filter_by_c, reflect_to_stable
from app.engine.recording import FloatArray

COLLINEAR = 1e-11
"""A regressor that those before it explain but for this share of its sum of squares is left out."""

SMALLEST_RESIDUAL = 1e-13
"""Residual sums of squares below this share of y's are rounding: they are not told apart."""


@njit(cache=True, nogil=True)
def long_autoregression(
    y: FloatArray, v: FloatArray, yy: FloatArray, yv: FloatArray, vv: FloatArray, room: FloatArray, errors: FloatArray
) -> None:
    """Innovations of y from the last p samples of y and v, into `errors` (N,), 0 before sample p.

    yy, yv, vv: Gram matrices of the lags 0..p of y and 1..p of v, of yy and vv the upper triangles. room: (2p + 3,
    2p + 1) to work in. The regressors are interleaved by lag, so that where two say the same the longer lag is left
    out.
    """
    p = vv.shape[0]
    size = 2 * p + 1
    for i in range(p):
        for j in range(i, p):
            room[2 * i, 2 * j] = yy[i + 1, j + 1]
            room[2 * i, 2 * j + 1] = yv[i + 1, j]
            room[2 * i + 1, 2 * j] = yv[j + 1, i]
            room[2 * i + 1, 2 * j + 1] = vv[i, j]
        room[2 * i, 2 * p] = yy[0, i + 1]
        room[2 * i + 1, 2 * p] = yv[0, i]
    room[2 * p, 2 * p] = yy[0, 0]
    coefficients = room[size + 1]
    solve_least_squares(room, size, COLLINEAR, room[size], coefficients)
    errors[:p] = 0.0
    errors[p:] = y[p:]
    add_lagged(errors, -coefficients[0 : 2 * p : 2], y, p)
    add_lagged(errors, -coefficients[1 : 2 * p : 2], v, p)


@njit(cache=True, nogil=True)
def regression_gram(
    y: FloatArray,
    v: FloatArray,
    errors: FloatArray,
    yy: FloatArray,
    yv: FloatArray,
    vv: FloatArray,
    orders: tuple,
    first: int,
    gram: FloatArray,
) -> None:
    """The upper triangle over [y lags 1..na, v lags 1..nb, innovation lags 1..nc, y] into gram (size, size)."""
    na, nb, nc = orders
    target = na + nb + nc
    gram[:na, :na] = yy[1 : na + 1, 1 : na + 1]
    gram[:na, na : na + nb] = yv[1 : na + 1, :nb]
    gram[na : na + nb, na : na + nb] = vv[:nb, :nb]
    fill_lagged_gram(gram, 0, na + nb, y, errors, (1, na, 1, nc), first)
    fill_lagged_gram(gram, na, na + nb, v, errors, (1, nb, 1, nc), first)
    fill_own_gram(gram, na + nb, errors, (1, nc), first)
    for i in range(na):
        gram[i, target] = yy[0, i + 1]
    for j in range(nb):
        gram[na + j, target] = yv[0, j]
    lagged_dots(y, errors, 0, 1, first, gram[na + nb : target, target])
    gram[target, target] = yy[0, 0]


@njit(cache=True, nogil=True)
def criterion_value(residual: float, samples: int, parameters: int, logarithmic: bool) -> float:
    """AIC of a model: eq 7 of the paper, or Ljung's logarithmic form."""
    variance = residual / samples
    return (np.log(variance) if logarithmic else variance) + 2.0 * parameters / samples


@njit(cache=True, nogil=True)
def sweep_orders(
    gram: FloatArray,
    orders: tuple,
    samples: int,
    logarithmic: bool,
    room: FloatArray,
    left: FloatArray,
    values: FloatArray,
) -> None:
    """The criterion of every order into values (na, nb, nc + 1); `gram` is left as it is.

    The y lags are taken out one by one; after each, the v lags from a copy of what is left; after each of those, the
    innovation lags from a copy of what is left then, all copies abreast. Every order is one further step of a
    factorisation, not a new one. room: (3, size, size), left: (nc + 1, nc + 1, na nb).
    """
    na, nb, nc = orders
    size = na + nb + nc + 1
    smallest = SMALLEST_RESIDUAL * gram[size - 1, size - 1]
    floors, factors = np.empty(na * nb), np.empty(na * nb)
    room[0] = gram
    for i in range(na):
        eliminate(room[0], i, size, COLLINEAR * gram[i, i])
        room[1, na:, na:] = room[0, na:, na:]
        for j in range(nb):
            eliminate(room[1], na + j, size, COLLINEAR * gram[na + j, na + j])
            for r in range(nc + 1):
                for s in range(r, nc + 1):
                    left[r, s, i * nb + j] = room[1, na + nb + r, na + nb + s]
    for k in range(nc + 1):
        if k > 0:
            e = na + nb + k - 1
            floors[:] = COLLINEAR * gram[e, e]
            eliminate_abreast(left, k - 1, floors, factors)
        for i in range(na):
            for j in range(nb):
                residual = max(left[nc, nc, i * nb + j], smallest)
                values[i, j, k] = criterion_value(residual, samples, i + j + 2 + k, logarithmic)


@njit(cache=True, nogil=True)
def least(values: FloatArray, nc_min: int) -> tuple:
    """The order (na, nb, nc) of the least value; of equal ones the first, which is the smaller."""
    best = (0, 0, nc_min)
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            for k in range(nc_min, values.shape[2]):
                if values[i, j, k] < values[best]:
                    best = (i, j, k)
    return best[0] + 1, best[1] + 1, best[2]


@njit(cache=True, nogil=True)
def solve_order(
    gram: FloatArray, orders: tuple, chosen: tuple, room: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray
) -> None:
    """The coefficients of one order from the Gram matrix of all, into the first places of a, b, c; C made stable."""
    na, nb, nc = orders
    size = chosen[0] + chosen[1] + chosen[2] + 1
    places = np.empty(size, dtype=np.int64)
    for k in range(chosen[0]):
        places[k] = k
    for k in range(chosen[1]):
        places[chosen[0] + k] = na + k
    for k in range(chosen[2]):
        places[chosen[0] + chosen[1] + k] = na + nb + k
    places[size - 1] = na + nb + nc
    for i in range(size):
        for j in range(i, size):
            room[0, i, j] = gram[places[i], places[j]]
    coefficients = room[2, 0]
    solve_least_squares(room[0], size, COLLINEAR, room[1, 0], coefficients)
    a[:], b[:], c[:] = 0.0, 0.0, 0.0
    a[: chosen[0]] = -coefficients[: chosen[0]]
    b[: chosen[1]] = coefficients[chosen[0] : chosen[0] + chosen[1]]
    c[: chosen[2]] = coefficients[chosen[0] + chosen[1] : size - 1]
    reflect_to_stable(c[: chosen[2]])


@njit(cache=True, nogil=True)
def filtered_gram(
    y: FloatArray,
    v: FloatArray,
    errors: FloatArray,
    c: FloatArray,
    orders: tuple,
    first: int,
    filtered: FloatArray,
    gram: FloatArray,
) -> None:
    """The Gram matrix of the lags 1.. of y, v and the errors, each through 1/C; upper triangle without the last column.

    These lags are the derivatives of the prediction errors, but for the first samples. filtered: (3, N), filled.
    """
    na, nb, nc = orders
    filter_by_c(y, c, filtered[0], 0)
    filter_by_c(v, c, filtered[1], 0)
    filter_by_c(errors, c, filtered[2], 0)
    y, v, e = filtered[0], filtered[1], filtered[2]
    fill_own_gram(gram, 0, y, (1, na), first)
    fill_lagged_gram(gram, 0, na, y, v, (1, na, 1, nb), first)
    fill_lagged_gram(gram, 0, na + nb, y, e, (1, na, 1, nc), first)
    fill_own_gram(gram, na, v, (1, nb), first)
    fill_lagged_gram(gram, na, na + nb, v, e, (1, nb, 1, nc), first)
    fill_own_gram(gram, na + nb, e, (1, nc), first)


@njit(cache=True, nogil=True)
def efficient_gram(
    y: FloatArray,
    v: FloatArray,
    errors: FloatArray,
    c: FloatArray,
    orders: tuple,
    first: int,
    filtered: FloatArray,
    gram: FloatArray,
) -> None:
    """The third regression: one Gauss-Newton step from a model of one order to every order, upper triangle.

    With y', v' and e' the signals through the model's 1/C, y' + e - e' is regressed on the lags of y', v' and e'.
    """
    na, nb, nc = orders
    target = na + nb + nc
    filtered_gram(y, v, errors, c, orders, first, filtered, gram)
    goal = filtered[0] + errors - filtered[2]
    lagged_dots(goal, filtered[0], 0, 1, first, gram[:na, target])
    lagged_dots(goal, filtered[1], 0, 1, first, gram[na : na + nb, target])
    lagged_dots(goal, filtered[2], 0, 1, first, gram[na + nb : target, target])
    gram[target, target] = lagged_dot(goal, goal, 0, 0, first)
