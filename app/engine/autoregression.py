"""How a signal is foretold from its own past."""

import numpy as np
from scipy.linalg import solve_toeplitz

from app.engine.recording import FloatArray

RIDGE = 1e-9


def autoregression(series: FloatArray, order: int) -> FloatArray:
    """Weights (order,) of the samples before by which a series (N,), not all zero, foretells itself best, by the
    equations of Yule and Walker. Source: Box, Jenkins, Reinsel, Ljung, doi 10.1002/9781118619193, chapter 3.
    """
    covariances = autocovariances(series, order)
    return np.asarray(solve_toeplitz(covariances[:-1], covariances[1:]))


def autocovariances(series: FloatArray, order: int) -> FloatArray:
    """(order + 1,) sums of products at the lags 0 to order, the first a trifle larger, as a ridge."""
    sums = np.array([series[lag:] @ series[: len(series) - lag] for lag in range(order + 1)])
    sums[0] *= 1.0 + RIDGE
    return sums
