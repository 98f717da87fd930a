"""What foretells the next value of PV: its own past, and what else is known by then (Granger's causality).

Source: Granger 1969, Investigating causal relations by econometric models and cross-spectral methods,
doi 10.2307/1912791.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numba import njit

from app.engine.recording import BoolArray, FloatArray
from app.engine.signals.sampled import blocks, forgetting, unit_deviation

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

    What is known by then is laid out in rows (k, n), a row for each of k terms, of the n means that are foretold: each
    lies in one piece.
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
        """(..., terms, n): the last means before it, at most `order`, of one signal (N,) or of many, (M, N)."""
        return self._past_of(self._means(x), terms)

    def whole_past(self, x: FloatArray) -> FloatArray:
        """(k, n): the last means, and what x was lately, within the last of them. A controller has seen what PV was by
        then, and OP would tell it; a stem has gone along with what OP was.
        """
        return np.vstack((self.past(x, self.order), *self._lately(x)))

    def all_past(self, x: FloatArray) -> tuple[FloatArray, ...]:
        """What `whole_past` has, (terms, n) and then (n,) each, and what x was over longer times than that, as averages
        that forget exponentially.
        """
        means = self._means(x)
        longer = [unit_deviation(forgetting(means, memory))[self.order - 1 : -1] for memory in MEMORIES]
        return self._past_of(means, self.order), *self._lately(x), *longer

    def _past_of(self, means: FloatArray, terms: int) -> FloatArray:
        known = means[..., self.order - terms : -1]
        shape = (*known.shape[:-1], terms, known.shape[-1] - terms + 1)
        strides = (*known.strides, known.strides[-1])
        return np.lib.stride_tricks.as_strided(known, shape, strides, writeable=False)

    def _lately(self, x: FloatArray) -> list[FloatArray]:
        lengths = [2**k for k in range(self.stride.bit_length()) if 2**k < self.stride]
        return [_newest_means(x, self.stride, length)[self.order - 1 : -1] for length in lengths]

    def touched(self, samples: BoolArray, within: int) -> BoolArray:
        """(n,): whether one of these samples (N,) is in what is foretold or in the last `within` means before it."""
        means: BoolArray = np.any(blocks(samples, self.stride), axis=1)
        place = np.arange(len(means))
        newest = np.maximum.accumulate(np.where(means, place, -within - 1))
        return np.asarray(place - newest <= within)[self.order :]

    def _means(self, x: FloatArray) -> FloatArray:
        means = np.array([_newest_means(one, self.stride, self.stride) for one in np.atleast_2d(x)])
        return means.reshape(*x.shape[:-1], -1)


@dataclass(frozen=True, eq=False)
class Table:
    """What is known of each of n values of PV, a row for each term, and that value as the last row: (terms + 1, n).

    parts: of the values, (P,). products: (P, terms + 1, terms + 1) of the rows with each other over each of them.
    """

    rows: FloatArray
    parts: tuple[slice, ...]
    products: FloatArray

    @classmethod
    def in_parts(cls, rows: FloatArray, parts: int) -> "Table":
        edges = [rows.shape[1] * k // parts for k in range(parts + 1)]
        slices = tuple(slice(start, end) for start, end in pairwise(edges))
        return cls(rows, slices, _products(rows, rows, slices))

    @property
    def values(self) -> int:
        """n, of PV."""
        return self.rows.shape[1]

    @cached_property
    def missed(self) -> FloatArray:
        """(P,): sums of squares that one fit to all parts leaves in each."""
        weights = np.append(-self._fit[1], 1.0)
        return np.asarray(np.maximum(weights @ self.products @ weights, 0.0))

    @property
    def foretells_all(self) -> bool:
        """Whether what is missed is rounding alone: nothing can add to that."""
        return bool(self.missed.sum() <= FORETOLD * self.products[:, -1, -1].sum())

    def beside(self, more: FloatArray) -> "Table":
        """With further terms (k, n) of what is known."""
        size, k = self.products.shape[1], len(more)
        across, among = self._products_with(more[None])
        products = np.block([[self.products, across[0]], [across[0].transpose(0, 2, 1), among[0]]])
        order = [*range(size - 1), *range(size, size + k), size - 1]
        rows = np.vstack((self.rows[:-1], more, self.rows[-1]))
        return Table(rows, self.parts, products[:, order][:, :, order])

    def worths(self, more: FloatArray) -> FloatArray:
        """(M, P): by how much each of M sets of further terms (M, k, n) raises the logarithm of the likelihood of each
        part, under normal misses of one variance.
        """
        sizes = np.array([part.stop - part.start for part in self.parts])
        before, after = self.missed, self._missed_beside(more)
        was, now = (
            np.maximum(missed.sum(axis=-1, keepdims=True), np.finfo(float).tiny) / self.values
            for missed in (before, after)
        )
        return np.asarray(0.5 * (before / was - after / now) + 0.5 * sizes * np.log(was / now))

    @cached_property
    def _fit(self) -> tuple[FloatArray, FloatArray]:
        """Products of what is known over all parts, as they are inverted, and the weights of it."""
        products = self.products.sum(axis=0)
        return _firm(products[:-1, :-1], products[0, 0]), fitted(products, len(products) - 1)

    def _missed_beside(self, more: FloatArray) -> FloatArray:
        """(M, P): what is missed with further terms (M, k, n), by the Schur complement of what is known: each set costs
        a fit of k terms.
        """
        across, among = self._products_with(more)
        firm, weights = self._fit
        cross = across.sum(axis=1)
        known, value = cross[:, :-1], cross[:, -1]
        # Of the further terms, in what is known; side by side, because it would be inverted for each set otherwise.
        along = np.linalg.solve(firm, known.swapaxes(0, 1).reshape(len(firm), -1))
        along = along.reshape(len(firm), len(more), -1).swapaxes(0, 1)
        left = _firm(among.sum(axis=1), firm[0, 0]) - known.transpose(0, 2, 1) @ along
        added = np.linalg.solve(left, (value - weights @ known)[..., None])
        kept = weights - (along @ added)[..., 0]
        whole, added = np.column_stack((-kept, np.ones(len(more)))), added[:, None]
        alone = np.vecdot(whole @ self.products, whole).T[..., None, None]
        missed = alone - 2.0 * whole[:, None, None, :] @ across @ added
        return np.asarray(np.maximum(missed + added.swapaxes(2, 3) @ among @ added, 0.0)[..., 0, 0])

    def _products_with(self, more: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M, P, terms + 1, k) and (M, P, k, k): of further terms (M, k, n) with these and with each other."""
        sets, k, values = more.shape
        abreast = more.reshape(-1, values)
        across = _products(self.rows, abreast, self.parts).reshape(len(self.parts), -1, sets, k)
        # One product of all sets, of which little is asked, costs less than one of each.
        among = _products(abreast, abreast, self.parts).reshape(len(self.parts), sets, k, sets, k)
        each = np.arange(sets)
        return across.transpose(2, 0, 1, 3), among[:, each, :, each]


def _products(a: FloatArray, b: FloatArray, parts: tuple[slice, ...]) -> FloatArray:
    return np.array([a[:, part] @ b[:, part].T for part in parts])


def not_far(missed: FloatArray) -> BoolArray:
    """(n,) True where a miss (n,), of a PV at unit deviation, is no upset: at most FAR times the median one."""
    return np.asarray(np.abs(missed) <= FAR * float(np.median(np.abs(missed))))


def left_over(gram: FloatArray, terms: int) -> float:
    """Sum of squares of what the first `terms` rows of a table (k, n) do not explain of its last one, by least squares.
    gram: (k, k), the table's product with itself.
    """
    weights, among, along = fitted(gram, terms), gram[:terms, :terms], gram[:terms, -1]
    return float(gram[-1, -1] - 2.0 * along @ weights + weights @ among @ weights)


def fitted(gram: FloatArray, terms: int) -> FloatArray:
    """(terms,) weights of the first rows that explain the last one best. gram: (k, k) as in `left_over`; a ridge of
    RIDGE keeps rows that are made of each other solvable.
    """
    return np.asarray(np.linalg.solve(_firm(gram[:terms, :terms], gram[0, 0]), gram[:terms, -1]))


def _firm(among: FloatArray, scale: float) -> FloatArray:
    """Products of rows (..., k, k) that can be inverted, also where some are made of the others."""
    return among + RIDGE * scale * np.eye(among.shape[-1])


@njit(cache=True, nogil=True)
def _newest_means(x: FloatArray, stride: int, newest: int) -> FloatArray:
    """(N // stride,) at unit deviation: means of the last `newest` of each `stride` samples of x (N,)."""
    means = np.empty(len(x) // stride)
    for i in range(len(means)):
        total, end = 0.0, (i + 1) * stride
        for k in range(end - newest, end):
            total += x[k]
        means[i] = total / newest
    return unit_deviation(means)
