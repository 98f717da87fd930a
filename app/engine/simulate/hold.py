"""A linear system behind a zero-order hold."""

import numpy as np
from scipy import linalg

from app.engine.recording import FloatArray


def zero_order_hold(a: FloatArray, b: FloatArray, time_s: float) -> tuple[FloatArray, FloatArray]:
    """State matrix (n, n) and input column (n,) over time_s of x' = a x + b u with u held; a (n, n), b (n, 1).

    By the exponential of the block matrix (Van Loan 1978, doi 10.1109/TAC.1978.1101743).
    """
    order = len(a)
    if time_s == 0.0:
        return np.eye(order), np.zeros(order)
    block = np.zeros((order + 1, order + 1))
    block[:order, :order], block[:order, order:] = a, b
    held = linalg.expm(block * time_s)
    return np.ascontiguousarray(held[:order, :order]), held[:order, order].copy()
