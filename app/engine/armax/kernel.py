"""Hannan and Rissanen's order search, compiled: one Gram matrix a valve position, all orders from nested factors."""

import numpy as np
from numba import njit

from app.engine.armax.gram import (
    LAST,
    NOW,
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
    fill_lagged_gram(gram, NOW, na + nb, y, errors, (LAST, na, LAST, nc), first)
    fill_lagged_gram(gram, na, na + nb, v, errors, (LAST, nb, LAST, nc), first)
    fill_own_gram(gram, na + nb, errors, (LAST, nc), first)
    for i in range(na):
        gram[i, target] = yy[0, i + 1]
    for j in range(nb):
        gram[na + j, target] = yv[0, j]
    lagged_dots(y, errors, NOW, LAST, first, gram[na + nb : target, target])
    gram[target, target] = yy[0, 0]


@njit(cache=True, nogil=True)
def criterion_value(residual: float, samples: int, parameters: int, logarithmic: bool) -> float:
    """AIC of a model: eq 7 of the paper, or Ljung's logarithmic form."""
    variance = residual / samples
    return (np.log(variance) if logarithmic else variance) + 2.0 * parameters / samples


@njit(cache=True, nogil=True)
def sweep_orders(gram: FloatArray, orders: tuple, rooms: tuple, residuals: FloatArray) -> None:
    """The residual sum of squares of every order into residuals (na, nb, nc + 1); `gram` is left as it is.

    The innovation lags are taken out one by one, and what is left after each is kept; from all that is kept, abreast,
    the y lags one by one, and from all that is left after each of those the v lags. Every order is one further step of
    a factorisation, not a new one. rooms: as `sweep_rooms` makes them, to work in.
    """
    na, nb, nc = orders
    whole, without_e, without_y, floors, factors = rooms
    size, abreast = na + nb + nc + 1, nc + 1
    _innovations_first(gram, orders, whole)
    for k in range(nc + 1):
        if k > 0:
            e = na + nb + k - 1
            eliminate(whole, k - 1, size, COLLINEAR * gram[e, e])
        _keep(whole, nc, without_e, k)
    for k in range(na):
        floors[:abreast] = COLLINEAR * gram[k, k]
        eliminate_abreast(without_e, k, floors[:abreast], factors[:abreast])
        _keep_abreast(without_e, na, without_y, k * abreast)
    smallest = SMALLEST_RESIDUAL * gram[size - 1, size - 1]
    for k in range(nb):
        floors[:] = COLLINEAR * gram[na + k, na + k]
        eliminate_abreast(without_y, k, floors, factors)
        residuals[:, k] = np.maximum(without_y[nb, nb], smallest).reshape((na, abreast))


@njit(cache=True, nogil=True)
def sweep_rooms(orders: tuple) -> tuple:
    """Room for `sweep_orders`: one matrix of all lags, nc + 1 without those of the innovations, na (nc + 1) without
    those of y too, and two rows of as many numbers."""
    na, nb, nc = orders
    size, last = na + nb + nc + 1, na * (nc + 1)
    without_e, without_y = np.empty((na + nb + 1, na + nb + 1, nc + 1)), np.empty((nb + 1, nb + 1, last))
    return np.empty((size, size)), without_e, without_y, np.empty(last), np.empty(last)


@njit(cache=True, nogil=True)
def _innovations_first(gram: FloatArray, orders: tuple, whole: FloatArray) -> None:
    """The upper triangle over [innovation lags, y lags, v lags, y] into `whole`, of one over [y, v, innovations, y]."""
    na, nb, nc = orders
    size = na + nb + nc + 1
    places = np.concatenate((np.arange(na + nb, size - 1), np.arange(na + nb), np.array([size - 1])))
    for i in range(size):
        for j in range(i, size):
            whole[i, j] = gram[min(places[i], places[j]), max(places[i], places[j])]


@njit(cache=True, nogil=True)
def _keep(matrix: FloatArray, first: int, kept: FloatArray, place: int) -> None:
    """The upper triangle of a matrix from row and column `first` on into kept[:, :, place]."""
    for i in range(kept.shape[0]):
        for j in range(i, kept.shape[0]):
            kept[i, j, place] = matrix[first + i, first + j]


@njit(cache=True, nogil=True)
def _keep_abreast(matrices: FloatArray, first: int, kept: FloatArray, place: int) -> None:
    """The same of matrices (size, size, M) that lie abreast, into kept[:, :, place : place + M]."""
    for i in range(kept.shape[0]):
        for j in range(i, kept.shape[0]):
            for m in range(matrices.shape[2]):
                kept[i, j, place + m] = matrices[first + i, first + j, m]


@njit(cache=True, nogil=True)
def least(residuals: FloatArray, samples: int, logarithmic: bool, nc_min: int) -> tuple:
    """The order (na, nb, nc) of the least criterion; of equal ones the first, which is the smaller."""
    na, nb, kinds = residuals.shape
    penalty = 2.0 * np.arange(na + nb + kinds) / samples
    growth = np.exp(penalty)  # of the variance that costs as much: the logarithm of a product is that of each, added
    best, lowest = (1, 1, nc_min), np.inf
    for i in range(na):
        for j in range(nb):
            for k in range(nc_min, kinds):
                parameters = i + j + 2 + k
                variance = residuals[i, j, k] / samples
                value = variance * growth[parameters] if logarithmic else variance + penalty[parameters]
                if value < lowest:
                    best, lowest = (i + 1, j + 1, k), value
    return best


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
def filtered_gram(filtered: FloatArray, orders: tuple, first: int, gram: FloatArray) -> None:
    """The Gram matrix of the lags 1.. of y, v and the errors, each through 1/C; upper triangle without the last column.

    These lags are the derivatives of the prediction errors, but for the first samples. filtered: the three in rows.
    """
    na, nb, nc = orders
    y, v, e = filtered[0], filtered[1], filtered[2]
    fill_own_gram(gram, NOW, y, (LAST, na), first)
    fill_lagged_gram(gram, NOW, na, y, v, (LAST, na, LAST, nb), first)
    fill_lagged_gram(gram, NOW, na + nb, y, e, (LAST, na, LAST, nc), first)
    fill_own_gram(gram, na, v, (LAST, nb), first)
    fill_lagged_gram(gram, na, na + nb, v, e, (LAST, nb, LAST, nc), first)
    fill_own_gram(gram, na + nb, e, (LAST, nc), first)


@njit(cache=True, nogil=True)
def efficient_gram(
    y: FloatArray, v: FloatArray, errors: FloatArray, c: FloatArray, orders: tuple, first: int, gram: FloatArray
) -> None:
    """The third regression: one Gauss-Newton step from a model of one order to every order, upper triangle.

    With y', v' and e' the signals through the model's 1/C, y' + e - e' is regressed on the lags of y', v' and e'.
    """
    na, nb, nc = orders
    target = na + nb + nc
    filtered = np.empty((3, len(y)))
    filtered[0], filtered[1], filtered[2] = y, v, errors
    filter_by_c(filtered, c, filtered)
    filtered_gram(filtered, orders, first, gram)
    goal = filtered[0] + errors - filtered[2]
    lagged_dots(goal, filtered[0], NOW, LAST, first, gram[:na, target])
    lagged_dots(goal, filtered[1], NOW, LAST, first, gram[na : na + nb, target])
    lagged_dots(goal, filtered[2], NOW, LAST, first, gram[na + nb : target, target])
    gram[target, target] = lagged_dot(goal, goal, NOW, NOW, first)
