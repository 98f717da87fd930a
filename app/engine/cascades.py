"""Cascades: which loops move the set point of another loop, and so no valve of their own."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.engine.excerpts import LENGTH, Excerpts
from app.engine.innovations import innovations
from app.engine.recording import FloatArray, IntArray

ORDER = 6

ALIKE = 0.9
"""Correlation of what is new in an OP and in an SP, from one sample to the next, from which they are one signal: one
stored to a tenth of a per cent, or a scan later, mostly has more. Strangers have 0.2; two loops that do nothing but
follow one load, measured with noise of a thousandth of the span, have 0.1 to 0.9, the more the slower the sampling."""

SCANS_APART = 1
"""By how many samples one may have been stored later than the other."""

FEWEST_MOVEMENTS = 16.0
"""Over how many samples the movement has to be spread: two signals that each step once are alike by chance."""

_AT_ONCE = 512  # set points that are compared in one product

Array32 = NDArray[np.float32]


@dataclass(frozen=True)
class Cascade:
    """outer: tag of the loop whose OP is the set point of the loop `inner`. alike: their correlation, 0..1."""

    outer: str
    inner: str
    alike: float


@dataclass(frozen=True, eq=False)
class _Signals:
    """What is new in one signal of each of some loops (M), an excerpt a row. tags: (M,). spread: (M,), as `_spread`.
    owner: (R,) of which loop. numbers: (R,) of the excerpts. new: (R, LENGTH - ORDER), at unit norm a loop.
    """

    tags: list[str]
    spread: FloatArray
    owner: IntArray
    numbers: IntArray
    new: Array32

    @classmethod
    def of(cls, excerpts: Mapping[str, Excerpts], which: Callable[[Excerpts], FloatArray | None]) -> "_Signals":
        tags, spread, numbers, found = [], [], [], []
        for tag, one in sorted(excerpts.items()):
            signal = which(one)
            new = None if signal is None else innovations(signal, ORDER)
            if signal is None or new is None:
                continue
            tags.append(tag)
            spread.append(_spread(np.diff(signal, axis=1)))
            numbers.append(one.numbers)
            found.append(new)
        owner = np.repeat(np.arange(len(tags)), [len(x) for x in found])
        return cls(
            tags,
            np.array(spread),
            owner,
            np.concatenate(numbers, dtype=np.int64) if numbers else np.empty(0, np.int64),
            np.concatenate(found, dtype=np.float32) if found else np.empty((0, LENGTH - ORDER), np.float32),
        )

    def begin(self) -> IntArray:
        """(M,) loops in the order in which their excerpts begin."""
        first = np.full(len(self.tags), np.iinfo(np.int64).max)
        np.minimum.at(first, self.owner, self.numbers)
        return np.argsort(first, kind="stable")

    def numbers_of(self, loops: IntArray) -> IntArray:
        return np.unique(self.numbers[np.isin(self.owner, loops)])

    def in_excerpts(self, loops: IntArray, numbers: IntArray) -> Array32:
        """(K, B, LENGTH - ORDER) of these loops (K,) in the excerpts of these numbers (B,), 0 where one is missing."""
        place = np.full(len(self.tags), -1)
        place[loops] = np.arange(len(loops))
        rows = (place[self.owner] >= 0) & np.isin(self.numbers, numbers)
        new = np.zeros((len(loops), len(numbers), LENGTH - ORDER), dtype=np.float32)
        new[place[self.owner[rows]], np.searchsorted(numbers, self.numbers[rows])] = self.new[rows]
        return new


def cascades(excerpts: Mapping[str, Excerpts]) -> tuple[Cascade, ...]:
    """The cascades among these loops by tag, ordered by outer, then inner loop. An OP may move several set points; of
    several loops whose OP is alike to one set point the nearest is its outer loop.

    Compared is what the past of OP and of SP does not foretell, from sample to sample and with either sign: what two
    loops have in common besides, a neighbour's swing, a load, a day's drift, does not make two signals one. Cost: for
    each set point that moves a product with each OP that does. Not found where a selector takes turns between outer
    loops, where OP and SP were stored at other intervals or compressed otherwise. Misleads where two loops without
    noise follow one load far faster than it moves, and no OP is nearer to the set point of one.
    """
    nearest: dict[str, Cascade] = {}
    for interval_s in sorted({one.interval_s for one in excerpts.values()}):
        for found in _among({tag: one for tag, one in excerpts.items() if one.interval_s == interval_s}):
            best = nearest.get(found.inner)
            if best is None or (-found.alike, found.outer) < (-best.alike, best.outer):
                nearest[found.inner] = found
    return tuple(sorted(nearest.values(), key=lambda one: (one.outer, one.inner)))


def _among(excerpts: Mapping[str, Excerpts]) -> Iterator[Cascade]:
    """Each pair of two loops of one sampling whose OP and SP are one signal."""
    ops, sps = _Signals.of(excerpts, lambda one: one.op), _Signals.of(excerpts, lambda one: one.sp)
    of_sp = {tag: row for row, tag in enumerate(sps.tags)}
    in_time = sps.begin()
    for some in (in_time[at : at + _AT_ONCE] for at in range(0, len(in_time), _AT_ONCE)):
        numbers = sps.numbers_of(some)
        near = np.unique(ops.owner[np.isin(ops.numbers, numbers)])
        if not len(near):
            continue
        alike = _correlations(sps.in_excerpts(some, numbers), ops.in_excerpts(near, numbers))
        for row, column in np.argwhere(alike >= ALIKE).tolist():
            sp, op = int(some[row]), int(near[column])
            outer, inner = ops.tags[op], sps.tags[sp]
            if outer == inner or min(ops.spread[op], sps.spread[sp]) < FEWEST_MOVEMENTS:
                continue
            # One recipe moves the set points of both, and what is new in an OP is its own set point's.
            own = of_sp.get(outer)
            if own is None or _alike(sps, sp, own) < alike[row, column]:
                yield Cascade(outer, inner, round(float(alike[row, column]), 4))


def _alike(signals: _Signals, one: int, other: int) -> float:
    numbers = signals.numbers_of(np.array([one]))
    new = signals.in_excerpts(np.array([one, other]), numbers)
    return float(_correlations(new[:1], new[1:])[0, 0])


def _correlations(some: Array32, others: Array32) -> Array32:
    """(M, K) how alike each of `some` (M, B, n) is to each of `others` (K, B, n) in the excerpts that both have, 0..1:
    the greatest correlation with one up to SCANS_APART later or earlier. 0 where they have no excerpt together.
    """
    power, power_too = (np.sum(x**2, axis=2) for x in (some, others))
    norm = np.sqrt((power @ (power_too > 0.0).T) * ((power > 0.0) @ power_too.T))
    most, n = np.zeros_like(norm), some.shape[2]
    for later in range(-SCANS_APART, SCANS_APART + 1):
        one, other = some[:, :, max(0, later) : n + min(0, later)], others[:, :, max(0, -later) : n - max(0, later)]
        product = one.reshape(len(some), -1) @ other.reshape(len(others), -1).T
        # The ends that have no counterpart have their share of the power.
        most = np.maximum(most, np.abs(product) * (n / (n - abs(later))))
    return np.minimum(np.divide(most, norm, out=np.zeros_like(most), where=norm > 0.0), 1.0)


def _spread(moves: FloatArray) -> float:
    """Over how many of the movements (B, n) all of it is spread: 1 for a single step, 0 where nothing moves."""
    largest = float(np.max(np.abs(moves)))
    if largest == 0.0:
        return 0.0
    power = (moves / largest) ** 2
    return float(np.sum(power) ** 2 / np.sum(power**2))
