"""How much bicoherence Gaussian noise has by chance, the lines of its spectrum and its segments being no strangers."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import chdtri

from app.engine.recording import BoolArray, FloatArray, IntArray
from app.engine.signals.sampled import hann

SEGMENT = 64

FIRST, SECOND = (
    np.array(lines)
    for lines in zip(
        *((i, j) for i in range(1, SEGMENT // 2) for j in range(i, SEGMENT // 2) if i + j <= SEGMENT // 2),
        strict=True,
    )
)
"""(L,) each: the pairs of lines of the principal domain, and FIRST + SECOND their sums."""

CHANCE = 0.05

_ALIKE = np.array([1.0, -2.0 / 3.0, 1.0 / 6.0, 0.0])
"""Correlation of a noise's lines under Hann's window, by how many lines they are apart; from the third on none."""


@dataclass(frozen=True, eq=False)
class _Noise:
    """K bic^2 of the pairs under Gaussian noise: expected (L,), and together (L, L) how they vary with each other."""

    expected: FloatArray
    together: FloatArray


def chance_limit(pairs: BoolArray, segments: int, hop: int) -> float:
    """What the mean bic^2 of some pairs of lines exceeds under Gaussian noise in 5 % of records.

    pairs: (L,) which of FIRST, SECOND are averaged, one at least. segments: K, under Hann's window, `hop` samples from
    one to the next, no whole number of cycles of what swings.

    With the triple product P = X_i X_j X*_(i+j), 2 K bic^2 is about chi-square with two degrees of freedom, and the
    squared correlations of P are how the pairs vary together. The mean of n pairs is then about chi-square with
    nu = 2 (sum of what is expected)^2 / (sum of what varies together) degrees of freedom instead of 2 n: some 210
    instead of 512 for all pairs. As bic^2 cannot exceed 1, its variance is less by (K - 1) / (K + 1).
    Within 2 % for white noise; the lines of a coloured one are taken to be as alike. Of white, coloured and
    swinging Gaussian noise, 300 to 8,000 samples, 1 to 7 % of records exceed it, of 2,000 samples that swing with 20
    to 28 a cycle 6 to 11 %.
    """
    noise, chosen = _noise(hop), pairs.astype(np.float64)
    expected = float(chosen @ noise.expected)
    freedom = 2.0 * expected**2 / float(chosen @ noise.together @ chosen) * (segments + 1) / max(segments - 1, 1)
    return expected / float(chosen.sum()) / segments * float(chdtri(freedom, CHANCE)) / freedom


@lru_cache(maxsize=SEGMENT)
def _noise(hop: int) -> _Noise:
    """The covariances of P by Isserlis, summed over segments that overlap.

    Lines pair across two P: X_i with X_i' or X_j', X_j with the other, X_(i+j) with its like. And X_j with X_(i+j)
    within each P, where i is 1 or 2 and they are neighbours: what is left is X_i, the same in many P.
    """
    i, j, total = FIRST, SECOND, FIRST + SECOND
    later = range(hop, SEGMENT, hop)
    overlap = np.array([_overlap(shift) for shift in later])
    turned = np.cos(2.0 * np.pi * np.outer(i, later) / SEGMENT)
    segments_alike = 1.0 + 2.0 * float(np.sum(overlap**3))
    line_alike = np.sqrt(np.abs(1.0 + 2.0 * turned @ overlap))
    straight, crossed = _between(i, i) * _between(j, j), _between(i, j) * _between(j, i)
    across = segments_alike * _between(total, total) * (straight + crossed)
    inner = _alike(i) * line_alike
    within = _between(i, i) * np.outer(inner, inner)
    # P of a pair of neighbours, and of a line with itself, is larger, and so is what bic^2 divides by.
    size = np.sqrt(1.0 + _alike(i - j) ** 2)
    covariance = (across + within) / np.outer(size, size)
    expected, together = np.diag(covariance).copy(), covariance**2
    expected.flags.writeable = together.flags.writeable = False  # kept for who asks next
    return _Noise(expected, together)


def _between(one: IntArray, other: IntArray) -> FloatArray:
    return _alike(one[:, None] - other)


def _alike(lines_apart: IntArray) -> FloatArray:
    return _ALIKE[np.minimum(np.abs(lines_apart), len(_ALIKE) - 1)]


def _overlap(shift: int) -> float:
    """Correlation of the same line of two segments so many samples apart, but for its turn."""
    window = hann(SEGMENT)
    return float(window[shift:] @ window[: SEGMENT - shift] / (window @ window))
