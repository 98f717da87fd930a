"""What a richer noise model would have explained as well: two poles and two zeros are few, and under feedback OP
carries the noise, so that a block which answers OP may take what the noise model lacks.
"""

import numpy as np
from scipy.linalg import solve_toeplitz

from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.spikes import innovations
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.noise import compared_count
from app.engine.recording import FloatArray

ORDER = 8
RIDGE = 1e-9


def taken_by_noise(contender: Contender) -> float:
    """The part of a contender's gain (nat, not below 0) that noise alone would have had, were its model richer by an
    autoregression of the innovations.
    """
    return max(predictable(contender.over) - predictable(contender.fit), 0.0)


def predictable(fit: Fit) -> float:
    """The log-likelihood (nat) that an autoregression of ORDER lags gains over white innovations."""
    e, count = innovations(fit), compared_count(fit.record.usable)
    if count <= 2 * ORDER:
        return 0.0
    covariances = autocovariances(e, ORDER)
    left = 1.0 - float(autoregression(e, ORDER) @ covariances[1:]) / float(covariances[0])
    return -0.5 * count * float(np.log(max(left, RIDGE)))


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
