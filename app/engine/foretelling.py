"""What foretells the next value of PV: its own past, and what else is known by then (Granger's causality).

Source: Granger 1969, Investigating causal relations by econometric models and cross-spectral methods,
doi 10.2307/1912791.
"""

from dataclasses import dataclass

import numpy as np

from app.engine.recording import BoolArray, FloatArray
from app.engine.sampled import blocks, forgetting

MEMORIES = (8.0, 24.0, 72.0)
"""Means after which what is older counts a third."""

FEWEST_A_TERM = 12
FAR = 7.5
"""Times the median miss; five standard deviations of a normal one. What is missed by more is an upset."""

RIDGE = 1e-10
FORETOLD = 1e-8
"""Share of what is foretold that is missed by rounding alone, at most: nothing can add to that."""


@dataclass(frozen=True)
class Lags:
    """How far back is looked, and how finely: a signal is taken as means of `stride` samples, because a quick loop
    answers within some of its samples and a slow one within some of the coarsest; each mean but the first `order` is
    foretold.

    What these tables hold has a row for each of the n means that are foretold.
    """

    stride: int
    order: int

    def fit_in(self, samples: int) -> bool:
        """Whether a record has enough of them."""
        return samples // self.stride >= self.order + self.fewest

    @property
    def fewest(self) -> int:
        """Rows below which nothing is told."""
        return FEWEST_A_TERM * self.order

    def value(self, x: FloatArray) -> FloatArray:
        """(n,): what is foretold, at unit deviation."""
        return self._means(x)[self.order :]

    def ones(self, x: FloatArray) -> FloatArray:
        """(n,): a constant."""
        return np.ones(len(x) // self.stride - self.order)

    def past(self, x: FloatArray, terms: int) -> FloatArray:
        """(n, terms): the last means before it, at most `order`."""
        return np.lib.stride_tricks.sliding_window_view(self._means(x)[self.order - terms : -1], terms)

    def whole_past(self, x: FloatArray) -> FloatArray:
        """(n, terms): the last means, and what x was lately, within the last of them. A controller has seen what PV was
        by then, and OP would tell it; a stem has gone along with what OP was.
        """
        within = blocks(x, self.stride)
        lengths = [2**k for k in range(self.stride.bit_length()) if 2**k < self.stride]
        lately = [_at_unit(within[:, -length:].mean(axis=1))[self.order - 1 : -1] for length in lengths]
        return np.column_stack((self.past(x, self.order), *lately))

    def long_past(self, x: FloatArray) -> FloatArray:
        """(n, 3): what x was over longer times than that, as averages that forget exponentially."""
        means = self._means(x)
        averages = [_at_unit(forgetting(means, memory)) for memory in MEMORIES]
        return np.column_stack(averages)[self.order - 1 : -1]

    def touched(self, samples: BoolArray, within: int) -> BoolArray:
        """(n,): whether one of these samples (N,) is in what is foretold or in the last `within` means before it."""
        means: BoolArray = np.any(blocks(samples, self.stride), axis=1)
        place = np.arange(len(means))
        newest = np.maximum.accumulate(np.where(means, place, -within - 1))
        return np.asarray(place - newest <= within)[self.order :]

    def _means(self, x: FloatArray) -> FloatArray:
        return _at_unit(blocks(x, self.stride).mean(axis=1))


def not_far(missed: FloatArray) -> BoolArray:
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


def _at_unit(x: FloatArray) -> FloatArray:
    return (x - x.mean()) / (float(x.std()) or 1.0)
