"""One-step prediction errors of an ARMAX model, filters by 1/C, and whether C is stable."""

import numpy as np
from numba import njit

from app.engine.armax.gram import add_lagged
from app.engine.armax.roots import roots_of
from app.engine.recording import FloatArray

SLOWEST_ROOT = 0.998
"""The roots of C stay within this radius: nearer to 1 the start of the record is not forgotten within it."""


@njit(cache=True, nogil=True)
def is_stable(c: FloatArray, radius: float) -> bool:
    """Whether all roots of 1 + c_1 q^-1 + .. lie within `radius`, by the step-down (Schur-Cohn) recursion."""
    n = len(c)
    work = np.empty(n)
    for k in range(n):
        work[k] = c[k] / radius ** (k + 1)
    below = np.empty(n)
    for order in range(n, 0, -1):
        reflection = work[order - 1]
        if not abs(reflection) < 1.0:
            return False
        for k in range(order - 1):
            below[k] = (work[k] - reflection * work[order - 2 - k]) / (1.0 - reflection * reflection)
        work[: order - 1] = below[: order - 1]
    return True


@njit(cache=True, nogil=True)
def reflect_to_stable(c: FloatArray) -> None:
    """Reflects the roots of C outside the unit circle into it, in place, and draws those near it to SLOWEST_ROOT.

    C(q) e has the same spectrum after a reflection; the other roots stay where they are.
    """
    n = len(c)
    if is_stable(c, SLOWEST_ROOT):
        return
    expanded = np.zeros(n + 1, dtype=np.complex128)
    expanded[0] = 1.0
    for root in roots_of(c):
        radius = abs(root)
        if radius > 1.0:
            root = 1.0 / np.conj(root)
            radius = 1.0 / radius
        if radius > 0.999 * SLOWEST_ROOT:
            root *= 0.999 * SLOWEST_ROOT / radius
        for k in range(n, 0, -1):
            expanded[k] -= root * expanded[k - 1]
    for k in range(n):
        c[k] = expanded[k + 1].real
    if not is_stable(c, SLOWEST_ROOT):
        c[:] = 0.0


@njit(cache=True, nogil=True, fastmath={"contract"})
def filter_by_c(x: FloatArray, c: FloatArray, out: FloatArray) -> None:
    """out = x / C(q) for each row of x (K, N), at rest before the first sample; in place where out is x.

    Four samples at a time: they share what they read of the samples before, and wait for each other only at the end.
    All rows abreast: while one waits, another goes on.
    """
    n, (rows, samples) = max(len(c), 3), x.shape
    oldest_first = np.zeros(n)
    oldest_first[n - len(c) :] = c[::-1]
    begun = min(n, samples)
    for row in range(rows):
        _filter_one_by_one(x[row], c, out[row], 0, begun)
    c1, c2, c3, further = oldest_first[n - 1], oldest_first[n - 2], oldest_first[n - 3], oldest_first[: n - 3]
    fours = (samples - begun) // 4
    for begin in range(0, 4 * fours, 4):
        for row in range(rows):
            new, known = x[row, n + begin : n + begin + 4], out[row, begin : begin + n + 4]
            e0, e1, e2, e3 = new[0], new[1], new[2], new[3]
            out0, out1, out2 = known[0], known[1], known[2]
            for k in range(len(further)):
                tap, out3 = further[k], known[k + 3]
                e0 -= tap * out0
                e1 -= tap * out1
                e2 -= tap * out2
                e3 -= tap * out3
                out0, out1, out2 = out1, out2, out3
            third, second, last = known[n - 3], known[n - 2], known[n - 1]
            e0 = e0 - c3 * third - c2 * second - c1 * last
            e1 = e1 - c3 * second - c2 * last - c1 * e0
            e2 = e2 - c3 * last - c2 * e0 - c1 * e1
            e3 = e3 - c3 * e0 - c2 * e1 - c1 * e2
            known[n], known[n + 1], known[n + 2], known[n + 3] = e0, e1, e2, e3
    for row in range(rows):
        _filter_one_by_one(x[row], c, out[row], begun + 4 * fours, samples)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _filter_one_by_one(x: FloatArray, c: FloatArray, out: FloatArray, begin: int, end: int) -> None:
    """out = x / C(q) for the samples begin..end-1, at rest before sample 0."""
    for t in range(begin, end):
        total = x[t]
        for k in range(min(t, len(c))):
            total -= c[k] * out[t - 1 - k]
        out[t] = total


@njit(cache=True, nogil=True)
def prediction_errors(
    y: FloatArray, v: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, errors: FloatArray
) -> None:
    """errors(t) = y(t) - y^(t|t-1) of A y = B v + C e, written to `errors` (N,); 0 before sample max(na, nb).

    The errors before the first one that can be computed are taken as 0.
    """
    start = max(len(a), len(b))
    errors[:start] = 0.0
    errors[start:] = y[start:]
    add_lagged(errors, a, y, start)
    add_lagged(errors, -b, v, start)
    late = errors[start:].reshape((1, len(errors) - start))
    filter_by_c(late, c, late)
