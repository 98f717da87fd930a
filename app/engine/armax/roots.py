"""The roots of a polynomial, all at once: Aberth's and Ehrlich's iteration, an order cheaper than eigenvalues."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.engine.recording import FloatArray

ComplexArray = NDArray[np.complex128]

_NOTHING = 1e-290  # what is smaller cannot be divided by
# It converges with the third power: after a step of this share of a root the next one would be rounding.
_LAST_STEP = 1e-9
_MOST_PASSES = 60


@njit(cache=True, nogil=True, error_model="numpy")
def roots_of(c: FloatArray) -> ComplexArray:
    """The n roots of z^n + c_1 z^(n-1) + .. + c_n for c = (c_1, .., c_n), finite, in no order.

    Where the iteration does not settle (roots that fall together, a root at 0) they are the eigenvalues of the
    companion matrix.
    Source: Aberth 1973, Iteration methods for finding all zeros of a polynomial simultaneously, Mathematics of
    Computation 27, 339-344.
    """
    n = len(c)
    # On the circle of the roots' geometric mean, off the real axis, about which the roots are mirrored.
    z = abs(c[n - 1]) ** (1.0 / n) * np.exp(1j * (2.0 * np.pi * np.arange(n) / n + 0.4))
    for _ in range(_MOST_PASSES if abs(c[n - 1]) > _NOTHING else 0):
        settled = True
        for k in range(n):
            step = _aberth_step(c, z, k)
            z[k] -= step
            settled = settled and abs(step) < _LAST_STEP * abs(z[k])
        if settled:
            return z
    polynomial = np.ones(n + 1, dtype=np.complex128)
    for k in range(n):
        polynomial[k + 1] = c[k] if abs(c[k]) > _NOTHING else 0.0
    return np.roots(polynomial)  # type: ignore[return-value]  # complex coefficients have complex roots


@njit(cache=True, nogil=True, error_model="numpy")
def _aberth_step(c: FloatArray, z: ComplexArray, k: int) -> complex:
    """Newton's step for root k of the polynomial with the other roots, as far as they are known, divided out."""
    here = z[k]
    value, slope = 1.0 + 0.0j, 0.0j
    for i in range(len(c)):
        slope = slope * here + value
        value = value * here + c[i]
    repelled = 0.0j
    for j in range(len(z)):
        if j != k:
            apart = here - z[j]
            repelled += apart.conjugate() / (apart.real**2 + apart.imag**2)
    divided_out = slope - value * repelled
    return value / divided_out if divided_out != 0.0 else 0.1 * here
