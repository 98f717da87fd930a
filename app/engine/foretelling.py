"""What foretells the next value of PV: its own past, and what else is known by then (Granger's causality).

Signals are taken as means of `stride` samples, because a quick loop answers within some of its samples and a slow one
within some of the coarsest. Source: Granger 1969, Investigating causal relations by econometric models and
cross-spectral methods, doi 10.2307/1912791.
"""

import numpy as np

from app.engine.recording import FloatArray
from app.engine.sampled import blocks, forgetting

ORDER = 8
"""How many of the last means are looked at."""

FEWEST = 12 * ORDER
FAR = 7.5
"""Times the median miss; five standard deviations of a normal one. What is missed by more is an upset."""

MEMORIES = (8.0, 24.0, 72.0)
"""Means after which what is older counts a third."""

RIDGE = 1e-10


def next_values(x: FloatArray, stride: int) -> FloatArray:
    """(n,): the means of x (N,) but the first ORDER, at unit deviation."""
    return _at_unit(blocks(x, stride).mean(axis=1))[ORDER:]


def past(x: FloatArray, stride: int) -> FloatArray:
    """(n, ORDER): the means before each of the next values."""
    return np.lib.stride_tricks.sliding_window_view(_at_unit(blocks(x, stride).mean(axis=1))[:-1], ORDER)


def own_past(pv: FloatArray, stride: int) -> FloatArray:
    """(n, terms): ones, the last means of PV, and what it was lately, within the last of them: a controller has seen
    that, and OP would tell it.
    """
    within = blocks(pv, stride)
    lately = [_at_unit(within[:, -k:].mean(axis=1))[ORDER - 1 : -1] for k in _shorter(stride)]
    return np.column_stack((np.ones(len(within) - ORDER), past(pv, stride), *lately))


def long_past(x: FloatArray, stride: int) -> FloatArray:
    """(n, 3): what x was over longer times than its past goes back, as averages that forget exponentially."""
    means = _at_unit(blocks(x, stride).mean(axis=1))
    return np.column_stack([_at_unit(forgetting(means, means_kept))[ORDER - 1 : -1] for means_kept in MEMORIES])


def long_enough(x: FloatArray, stride: int) -> bool:
    return len(x) // stride >= ORDER + FEWEST


def not_far(missed: FloatArray) -> np.ndarray:
    """Which of the misses (n,) are no upset."""
    return np.asarray(np.abs(missed) <= FAR * float(np.median(np.abs(missed))))


def left_over(gram: FloatArray, terms: int) -> float:
    """Sum of squares of what the first columns of a table do not explain of its last one. gram: its product with
    itself.
    """
    weights, among, along = fitted(gram, terms), gram[:terms, :terms], gram[:terms, -1]
    return float(gram[-1, -1] - 2.0 * along @ weights + weights @ among @ weights)


def fitted(gram: FloatArray, terms: int) -> FloatArray:
    """(terms,) weights of the first columns that explain the last one best."""
    among = gram[:terms, :terms] + RIDGE * gram[0, 0] * np.eye(terms)
    return np.asarray(np.linalg.solve(among, gram[:terms, -1]))


def _shorter(stride: int) -> list[int]:
    """1, 2, 4 .. below stride."""
    return [2**k for k in range(stride.bit_length()) if 2**k < stride]


def _at_unit(x: FloatArray) -> FloatArray:
    return (x - x.mean()) / (float(x.std()) or 1.0)
