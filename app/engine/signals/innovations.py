"""What is new in a signal: what its own past does not foretell."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.engine.recording import FloatArray

RIDGE = 1e-9
SAMPLES_A_LAG = 6
# A spike in one innovation is one sample, however large.
_CLIPPED_AT = 4.0


def innovations(x: FloatArray, order: int) -> FloatArray | None:
    """What the last `order` samples do not foretell of the next one, by one rule for all stretches of a signal.

    x: (B, n) stretches of n samples. Returns (B, n - order), all together at unit norm; None where x is too short or
    foretells itself altogether. Signals that swing or wander look alike by chance; what is new in each does not.
    Source: Haugh 1976, Checking the independence of two covariance-stationary time series,
    doi 10.1080/01621459.1976.10480353.
    """
    if x.shape[1] <= order or x.size < SAMPLES_A_LAG * order or np.ptp(x) == 0.0:
        return None
    x = (x - x.mean()) / x.std()
    # Least squares, not Yule and Walker: their weights leave a part of what swings in both, which is alike by chance.
    next_one = x[:, order:].ravel()
    past = np.ones((order + 1, len(next_one)))
    for k in range(order):
        past[k] = x[:, k : k - order].ravel()
    gram = past @ past.T + RIDGE * x.size * np.eye(order + 1)
    e = next_one - np.linalg.solve(gram, past @ next_one) @ past
    spread = float(np.std(e))
    if spread == 0.0:
        return None
    e = np.clip(e, -_CLIPPED_AT * spread, _CLIPPED_AT * spread)
    return np.asarray(e / np.sqrt(e @ e)).reshape(len(x), -1)


def apart(one: NDArray[Any], other: NDArray[Any], later: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """(.., n - |later|) each: the samples of `one` (.., n) beside those of `other` so many samples earlier."""
    n = one.shape[-1]
    return one[..., max(0, later) : n + min(0, later)], other[..., max(0, -later) : n - max(0, later)]
