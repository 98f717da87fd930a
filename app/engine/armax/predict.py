"""One-step prediction errors of an ARMAX model, filters by 1/C, and whether C is stable."""

import numpy as np
from numba import njit

from app.engine.armax.gram import add_lagged
from app.engine.armax.roots import roots_of
from app.engine.recording import FloatArray

SLOWEST_ROOT = 0.998
"""The roots of C stay within this radius: nearer to 1 the start of the record is not forgotten within it."""

_REORDERED_SUMS = {"reassoc", "contract"}


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


@njit(cache=True, nogil=True, fastmath=_REORDERED_SUMS)
def filter_by_c(x: FloatArray, c: FloatArray, out: FloatArray, first: int) -> None:
    """out = x / C(q) from sample `first` on, at rest before it; in place where out is x."""
    n = len(c)
    samples = len(x) - first
    late_x, late_out = x[first:], out[first:]
    for t in range(min(n, samples)):
        total = late_x[t]
        for k in range(t):
            total -= c[k] * late_out[t - 1 - k]
        late_out[t] = total
    if n == 0:
        late_out[:] = late_x
    if n == 0 or samples <= n:
        return
    # The newest value comes last and from a register, so that only one product waits for it.
    older, newest = c[:0:-1].copy(), late_out[n - 1]
    for t in range(samples - n):
        total = late_x[t + n]
        for k in range(n - 1):
            total -= older[k] * late_out[t + k]
        newest = total - c[0] * newest
        late_out[t + n] = newest


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
    filter_by_c(errors, c, errors, start)


@njit(cache=True, nogil=True, fastmath=_REORDERED_SUMS)
def sum_of_squares(errors: FloatArray, first: int) -> float:
    total = 0.0
    for t in range(first, len(errors)):
        total += errors[t] * errors[t]
    return total
