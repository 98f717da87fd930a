"""Gram matrices of lagged signals, from one row and one column of correlations and exact corrections at the edges."""

from typing import cast

import numpy as np
from numba import njit

from app.engine.recording import FloatArray
from app.engine.signals.sampled import REORDERED_SUMS

# Numbers of NumPy, because numba compiles a kernel anew for each literal that it is called with.
NOW, LAST = cast(int, np.int64(0)), cast(int, np.int64(1))
"""The lag of the present sample, and of the last one before it."""


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def lagged_dot(x: FloatArray, y: FloatArray, i: int, j: int, first: int) -> float:
    """The sum of x(t - i) y(t - j) over t = first..N-1."""
    # Slices, because an index with an offset is checked for its sign at every sample and keeps out of vector registers.
    late_x, late_y = x[first - i : len(x) - i], y[first - j : len(y) - j]
    total = 0.0
    for t in range(len(late_y)):
        total += late_x[t] * late_y[t]
    return total


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def lagged_dots(x: FloatArray, y: FloatArray, i: int, j: int, first: int, out: FloatArray) -> None:
    """`lagged_dot` of x at lag i with y at the lags j, j + 1, .. into out (k,), four of them in one pass over x."""
    late_x, end, lags = x[first - i : len(x) - i], len(y) - j, len(out)
    if lags < 4:
        for k in range(lags):
            out[k] = lagged_dot(x, y, i, j + k, first)
        return
    for place in range(0, lags, 4):
        k = min(place, lags - 4)  # the last four may overlap those before: the same sums again
        y0, y1 = y[first - j - k : end - k], y[first - j - k - 1 : end - k - 1]
        y2, y3 = y[first - j - k - 2 : end - k - 2], y[first - j - k - 3 : end - k - 3]
        dot0 = dot1 = dot2 = dot3 = 0.0
        for t in range(len(y0)):
            dot0 += late_x[t] * y0[t]
            dot1 += late_x[t] * y1[t]
            dot2 += late_x[t] * y2[t]
            dot3 += late_x[t] * y3[t]
        out[k], out[k + 1], out[k + 2], out[k + 3] = dot0, dot1, dot2, dot3


@njit(cache=True, nogil=True, fastmath={"contract"})
def add_lagged(out: FloatArray, weights: FloatArray, x: FloatArray, first: int) -> None:
    """out(t) += the sum of weights[k] x(t - 1 - k) over k, t = first..N-1; four lags in one pass over out, then two."""
    late_out, end = out[first:], len(x) - 1
    whole = len(weights) - len(weights) % 4
    for k in range(0, whole, 4):
        w0, w1, w2, w3 = weights[k], weights[k + 1], weights[k + 2], weights[k + 3]
        x0, x1 = x[first - 1 - k : end - k], x[first - 2 - k : end - k - 1]
        x2, x3 = x[first - 3 - k : end - k - 2], x[first - 4 - k : end - k - 3]
        for t in range(len(late_out)):
            late_out[t] += w0 * x0[t] + w1 * x1[t] + w2 * x2[t] + w3 * x3[t]
    pairs = len(weights) - len(weights) % 2
    for k in range(whole, pairs, 2):
        w0, w1, x0, x1 = weights[k], weights[k + 1], x[first - 1 - k : end - k], x[first - 2 - k : end - k - 1]
        for t in range(len(late_out)):
            late_out[t] = late_out[t] + w0 * x0[t] + w1 * x1[t]
    for k in range(pairs, len(weights)):
        weight, late_x = weights[k], x[first - 1 - k : end - k]
        for t in range(len(late_out)):
            late_out[t] += weight * late_x[t]


@njit(cache=True, nogil=True)
def fill_lagged_gram(
    gram: FloatArray, row: int, column: int, x: FloatArray, y: FloatArray, lags: tuple, first: int
) -> None:
    """Writes sum x(t - i) y(t - j), t = first..N-1, for lags i of x and j of y at gram[row + i - i0, column + j - j0].

    lags: (i0, rows, j0, columns), all lags at most `first`. Only the first row and column are summed: both lags one
    further is the same sum over samples one earlier, so two products correct it at the edges.
    """
    i0, rows, j0, columns = lags
    end = len(y)
    if rows == 0 or columns == 0:
        return
    lagged_dots(x, y, i0, j0, first, gram[row, column : column + columns])
    lagged_dots(y, x, j0, i0, first, gram[row : row + rows, column])
    for i in range(1, rows):
        for j in range(1, columns):
            p, q = i0 + i, j0 + j
            gram[row + i, column + j] = (
                gram[row + i - 1, column + j - 1] + x[first - p] * y[first - q] - x[end - p] * y[end - q]
            )


@njit(cache=True, nogil=True)
def fill_own_gram(gram: FloatArray, place: int, x: FloatArray, lags: tuple, first: int) -> None:
    """The upper triangle of `fill_lagged_gram` of x with itself, lags = (i0, number), from gram[place, place] on."""
    i0, number = lags
    end = len(x)
    if number == 0:
        return
    lagged_dots(x, x, i0, i0, first, gram[place, place : place + number])
    for i in range(1, number):
        for j in range(i, number):
            p, q = i0 + i, i0 + j
            gram[place + i, place + j] = (
                gram[place + i - 1, place + j - 1] + x[first - p] * x[first - q] - x[end - p] * x[end - q]
            )


@njit(cache=True, nogil=True, error_model="numpy")
def eliminate(gram: FloatArray, k: int, size: int, floor: float) -> None:
    """Takes column k out of the columns after it (one step of a Cholesky factorisation, upper triangle, in place).

    gram[j, j] for j > k then is the residual sum of squares of column j given columns 0..k. A column whose own residual
    is not above `floor` adds nothing that those before it do not say: its pivot is set to 0 and it is left out.
    """
    # Unsigned, because a signed index is checked for its sign at every element and keeps out of vector registers.
    taken, end = np.uint64(k), np.uint64(size)
    pivot = gram[taken, taken]
    if not pivot > floor:
        gram[taken, taken] = 0.0
        return
    for i in range(taken + np.uint64(1), end):
        factor = gram[taken, i] / pivot
        for j in range(i, end):
            gram[i, j] -= factor * gram[taken, j]


@njit(cache=True, nogil=True)
def back_substitute(gram: FloatArray, size: int, coefficients: FloatArray) -> None:
    """The coefficients of columns 0..size-2 for the last column, after `eliminate`; 0 for those left out."""
    target = size - 1
    for k in range(target - 1, -1, -1):
        coefficients[k] = 0.0
        if gram[k, k] > 0.0:
            rest = gram[k, target]
            for j in range(k + 1, target):
                rest -= gram[k, j] * coefficients[j]
            coefficients[k] = rest / gram[k, k]


@njit(cache=True, nogil=True, error_model="numpy")
def eliminate_abreast(grams: FloatArray, k: int, floors: FloatArray, factors: FloatArray) -> None:
    """`eliminate` of column k in each of M matrices grams (size, size, M), but for the pivots set to 0.

    They lie abreast, because a row of one is too short for vector registers. floors: (M,). factors: (M,) room.
    """
    size, abreast = grams.shape[0], grams.shape[2]
    for i in range(k + 1, size):
        for m in range(abreast):
            factors[m] = grams[k, i, m] / grams[k, k, m] if grams[k, k, m] > floors[m] else 0.0
        for j in range(i, size):
            for m in range(abreast):
                grams[i, j, m] -= factors[m] * grams[k, j, m]


@njit(cache=True, nogil=True)
def residuals_abreast(grams: FloatArray, tolerance: float, residuals: FloatArray) -> None:
    """The residual sums of squares (M,), at least 0, of the last column given those before it, in each of M matrices.

    grams: (size, size, M) upper triangles, destroyed. tolerance: a column whose residual is below this share of its own
    sum of squares is left out.
    """
    size, abreast = grams.shape[0], grams.shape[2]
    floors, factors = np.empty((size, abreast)), np.empty(abreast)
    for k in range(size):
        floors[k] = tolerance * grams[k, k]
    for k in range(size - 1):
        eliminate_abreast(grams, k, floors[k], factors)
    residuals[:] = np.maximum(grams[size - 1, size - 1], 0.0)


@njit(cache=True, nogil=True)
def solve_least_squares(
    gram: FloatArray, size: int, tolerance: float, diagonal: FloatArray, coefficients: FloatArray
) -> float:
    """Coefficients of the last column on those before it, in place; returns the residual sum of squares (at least 0).

    gram: (size, size) upper triangle, destroyed. tolerance: a column whose residual is below this share of its own sum
    of squares is left out. diagonal: (size,) room to work.
    """
    for k in range(size):
        diagonal[k] = gram[k, k]
    for k in range(size - 1):
        eliminate(gram, k, size, tolerance * diagonal[k])
    back_substitute(gram, size, coefficients)
    return max(gram[size - 1, size - 1], 0.0)
