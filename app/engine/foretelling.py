"""What foretells the next value of PV: its own past, and what else is known by then (Granger's causality).

Source: Granger 1969, Investigating causal relations by econometric models and cross-spectral methods,
doi 10.2307/1912791.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

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


@dataclass(frozen=True, eq=False)
class Table:
    """What is known of each value of PV, and that value as the last column of the rows (n, terms + 1).

    parts: of the rows, (P,). products: (P, terms + 1, terms + 1) of the columns with each other over each of them.
    """

    rows: FloatArray
    parts: tuple[slice, ...]
    products: FloatArray

    @classmethod
    def in_parts(cls, rows: FloatArray, parts: int) -> "Table":
        edges = [len(rows) * k // parts for k in range(parts + 1)]
        slices = tuple(slice(start, end) for start, end in pairwise(edges))
        return cls(rows, slices, _products(rows, rows, slices))

    @cached_property
    def missed(self) -> FloatArray:
        """(P,): sums of squares that one fit to all parts leaves in each."""
        return _missed(self.products)

    @property
    def foretells_all(self) -> bool:
        """Whether what is missed is rounding alone: nothing can add to that."""
        return bool(self.missed.sum() <= FORETOLD * self.products[:, -1, -1].sum())

    def beside(self, more: FloatArray) -> "Table":
        """With further columns (n, k) of what is known."""
        rows = np.column_stack((self.rows[:, :-1], more, self.rows[:, -1]))
        return Table(rows, self.parts, self._products_beside(more))

    def worth(self, more: FloatArray) -> FloatArray:
        """(P,): by how much further columns (n, k) raise the logarithm of the likelihood of each part, under normal
        misses of one variance.
        """
        sizes = np.array([part.stop - part.start for part in self.parts])
        before, after = self.missed, _missed(self._products_beside(more))
        was, now = (max(float(missed.sum()), np.finfo(float).tiny) / sizes.sum() for missed in (before, after))
        return np.asarray(0.5 * (before / was - after / now) + 0.5 * sizes * np.log(was / now))

    def _products_beside(self, more: FloatArray) -> FloatArray:
        parts, size, k = len(self.parts), self.products.shape[1], more.shape[1]
        known_at = [*range(size - 1), size - 1 + k]
        more_at = list(range(size - 1, size - 1 + k))
        products = np.empty((parts, size + k, size + k))
        products[np.ix_(range(parts), known_at, known_at)] = self.products
        products[np.ix_(range(parts), more_at, more_at)] = _products(more, more, self.parts)
        across = _products(self.rows, more, self.parts)
        products[np.ix_(range(parts), known_at, more_at)] = across
        products[np.ix_(range(parts), more_at, known_at)] = across.transpose(0, 2, 1)
        return products


def _products(a: FloatArray, b: FloatArray, parts: tuple[slice, ...]) -> FloatArray:
    return np.array([a[part].T @ b[part] for part in parts])


def _missed(products: FloatArray) -> FloatArray:
    weights = np.append(-fitted(products.sum(axis=0), products.shape[1] - 1), 1.0)
    return np.asarray(np.maximum(weights @ products @ weights, 0.0))


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
