"""Cascades: which loops move the set point of another loop, and so no valve of their own."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from app.engine.plant_wide.excerpts import LENGTH, Excerpts
from app.engine.recording import Array32, FloatArray, IntArray, Steps
from app.engine.signals.innovations import apart, innovations

ORDER = 6

ALIKE = 0.9
"""Correlation of what is new in an OP and in an SP, from one sample to the next, from which they are one signal: one
stored to a tenth of a per cent, or a scan later, mostly has more. Strangers have 0.2; two loops that do nothing but
follow one load, measured with noise of a thousandth of the span, have 0.1 to 0.9, the more the slower the sampling."""

ON_ONE_LINE = 0.99
"""Correlation of OP and SP themselves within the excerpts: what a ratio takes from a loop's PV is as new as that loop's
OP, by its proportional action, and has 0.92 at most beside it."""

ALMOST = 0.6
"""Likeness from which two signals are looked at closely."""

MOSTLY = 0.75
"""In how many of the excerpts in which both move: an operator takes an inner loop out of cascade for a while."""

SCANS_APART = 2
"""By how many samples one may have been stored later than the other."""

FEWEST_MOVES, LEFT_OUT = 5, 3
"""What two loops share in a trip is a few moves, or alike in its largest samples alone, and is no cascade."""

AS_NEAR = 1e-3
"""Likenesses so near to each other are the same: a loop under two tags, a set point that comes from elsewhere."""

AT_ONCE, BESIDE = 128, 2048  # set points and OPs that are compared in one product


@dataclass(frozen=True)
class Cascade:
    """outer: tag of the loop whose OP is the set point of the loop `inner`. alike: their correlation, 0..1."""

    outer: str
    inner: str
    alike: float


@dataclass(frozen=True, eq=False)
class _Signal:
    """Some excerpts of OP or SP: kept (B, LENGTH) of those with these numbers (B,)."""

    numbers: IntArray
    kept: Steps | FloatArray

    @property
    def values(self) -> FloatArray:
        """By a power of two, so exactly, at a size whose square is a number."""
        return np.ldexp(self.kept.astype(np.float64), -int(np.frexp(np.max(np.abs(self.kept)))[1]))


@dataclass(frozen=True, eq=False)
class _Signals:
    """What is new in one signal of each of some loops (M), an excerpt a row. tags: (M,). owner: (R,) of which loop.
    numbers: (R,) of the excerpts. new: (R, LENGTH - ORDER), at unit norm a loop.
    """

    tags: list[str]
    owner: IntArray
    numbers: IntArray
    new: Array32

    @classmethod
    def of(cls, signals: Mapping[str, _Signal]) -> "_Signals":
        """Each is written where it stays: of a plant they have tens of megabytes."""
        new = np.empty((sum(len(signal.numbers) for signal in signals.values()), LENGTH - ORDER), np.float32)
        tags: list[str] = []
        numbers: list[IntArray] = []
        end = 0
        for tag in sorted(signals):
            found = innovations(signals[tag].values, ORDER)
            if found is not None:
                begin, end = end, end + len(found)
                new[begin:end] = found
                tags.append(tag)
                numbers.append(signals[tag].numbers)
        owner = np.repeat(np.arange(len(tags)), [len(own) for own in numbers])
        return cls(tags, owner, np.concatenate([*numbers, np.empty(0, np.int64)]), new[:end])

    def begin(self) -> IntArray:
        """(M,) loops in the order in which their excerpts begin."""
        first = np.full(len(self.tags), np.iinfo(np.int64).max)
        np.minimum.at(first, self.owner, self.numbers)
        return np.argsort(first, kind="stable")

    def in_excerpts(self, loops: IntArray, numbers: IntArray) -> Array32:
        """(K, B, LENGTH - ORDER) of these loops (K,) in the excerpts of these numbers (B,), 0 where one is missing."""
        place = np.full(len(self.tags), -1)
        place[loops] = np.arange(len(loops))
        rows = (place[self.owner] >= 0) & np.isin(self.numbers, numbers)
        new = np.zeros((len(loops), len(numbers), LENGTH - ORDER), dtype=np.float32)
        new[place[self.owner[rows]], np.searchsorted(numbers, self.numbers[rows])] = self.new[rows]
        return new


def cascades(excerpts: Mapping[str, Excerpts], asked: Collection[str] | None = None) -> tuple[Cascade, ...]:
    """The cascades among these loops by tag, ordered by outer, then inner loop. An OP may move several set points; of
    several loops whose OP is alike to one set point the nearest is its outer loop, or all that are as near.

    asked: the loops of whose cascades alone is asked; None: of all.
    OP and SP have to lie on one line, of either slope, and what is new from sample to sample, which their past does not
    foretell, has to be alike: what two loops have in common besides, a neighbour's swing, a load, a day's drift, a
    ratio, does not make two signals one. Cost: for each set point that moves a product with each OP that does. Not
    found where a selector takes turns between outer loops, where the set point is filtered on its way or at a limit for
    half of the time, where OP and SP were stored at other intervals or compressed otherwise, and where either was
    rounded to more than a third of what it moves from sample to sample. Misleads where a controller is proportional or
    hardly integrates and another loop's set point is a ratio of its PV, where an OP follows a recipe that is another
    loop's set point and not its own, and where two loops follow one load far faster than it moves, hardly measured with
    noise, and no OP is nearer to the set point of one. That an OP moves a valve besides is not to be seen.
    """
    found: list[Cascade] = []
    for interval_s in sorted({one.interval_s for one in excerpts.values()}):
        alike = {tag: one for tag, one in excerpts.items() if one.interval_s == interval_s}
        ops, sps = _signals(alike, lambda one: one.op), _signals(alike, lambda one: one.sp)
        if asked is not None:
            moved = {pair.inner for pair in _pairs({tag: ops[tag] for tag in ops if tag in asked}, sps)}
            sps = {tag: sps[tag] for tag in sps if tag in moved or tag in asked}
        found += _nearest(list(_pairs(ops, sps)))
    if asked is not None:
        found = [one for one in found if one.outer in asked or one.inner in asked]
    return tuple(sorted(found, key=lambda one: (one.outer, one.inner)))


def _signals(
    excerpts: Mapping[str, Excerpts], which: Callable[[Excerpts], Steps | FloatArray | None]
) -> dict[str, _Signal]:
    return {tag: _Signal(one.numbers, x) for tag, one in excerpts.items() if (x := which(one)) is not None}


def _nearest(pairs: list[Cascade]) -> Iterator[Cascade]:
    best: dict[str, float] = {}
    for pair in pairs:
        best[pair.inner] = max(pair.alike, best.get(pair.inner, 0.0))
    for pair in pairs:
        if pair.alike >= best[pair.inner] - AS_NEAR:
            yield replace(pair, alike=round(pair.alike, 4))


def _pairs(ops: Mapping[str, _Signal], sps: Mapping[str, _Signal]) -> Iterator[Cascade]:
    """Each pair of two loops whose OP and SP are one signal, and nearer to each other than the two set points are: one
    recipe moves these, and what is new in an OP comes with its own."""
    for outer, inner in _looked_at(ops, sps):
        alike = _likeness(ops[outer], sps[inner])
        if alike >= ALIKE and (outer not in sps or _likeness(sps[outer], sps[inner]) < alike - AS_NEAR):
            yield Cascade(outer, inner, alike)


def _looked_at(ops: Mapping[str, _Signal], sps: Mapping[str, _Signal]) -> Iterator[tuple[str, str]]:
    """The pairs of two loops, outer and inner, that are almost alike."""
    if not ops or not sps:
        return  # what is new in the signals of a plant takes seconds, and is beside nothing
    new_ops, new_sps = _Signals.of(ops), _Signals.of(sps)
    in_time = new_sps.begin()
    for some in (in_time[at : at + AT_ONCE] for at in range(0, len(in_time), AT_ONCE)):
        numbers = np.unique(new_sps.numbers[np.isin(new_sps.owner, some)])
        near = np.unique(new_ops.owner[np.isin(new_ops.numbers, numbers)])
        set_points = new_sps.in_excerpts(some, numbers)
        for beside in (near[at : at + BESIDE] for at in range(0, len(near), BESIDE)):
            alike = _correlations(set_points, new_ops.in_excerpts(beside, numbers))
            for row, column in np.argwhere(alike >= ALMOST).tolist():
                outer, inner = new_ops.tags[beside[column]], new_sps.tags[some[row]]
                if outer != inner:
                    yield outer, inner


def _correlations(some: Array32, others: Array32) -> Array32:
    """(M, K) how alike each of `some` (M, B, n) is to each of `others` (K, B, n) in the excerpts that both have, 0..1:
    the greatest correlation with one up to SCANS_APART later or earlier. 0 where they have no excerpt together.
    """
    power, power_too = (np.sum(x**2, axis=2) for x in (some, others))
    norm = np.sqrt((power @ (power_too > 0.0).T) * ((power > 0.0) @ power_too.T))
    most, n = np.zeros_like(norm), some.shape[2]
    for later in range(-SCANS_APART, SCANS_APART + 1):
        one, other = apart(some, others, later)
        product = one.reshape(len(some), -1) @ other.reshape(len(others), -1).T
        # The ends that have no counterpart have their share of the power.
        most = np.maximum(most, np.abs(product) * (n / (n - abs(later))))
    return np.divide(most, norm, out=np.zeros_like(most), where=norm > 0.0)


def _likeness(one: _Signal, other: _Signal) -> float:
    """How alike two signals are, 0..1, in the excerpts that both have and in which they lie on one line, without the
    samples that are most so; 0 where those are too few of the excerpts in which both move, or tell too little.
    """
    _, mine, others = np.intersect1d(one.numbers, other.numbers, return_indices=True)
    x, y = one.values[mine], other.values[others]
    moving = [k for k in range(len(x)) if np.ptp(x[k]) > 0.0 and np.ptp(y[k]) > 0.0]
    on_line = [k for k in moving if _greatest(_centred(x[k]), _centred(y[k])) >= ON_ONE_LINE]
    if len(on_line) < max(1.0, MOSTLY * len(moving)):
        return 0.0
    x, y = x[on_line], y[on_line]
    new_x, new_y = innovations(x, ORDER), innovations(y, ORDER)
    if new_x is None or new_y is None or min(np.count_nonzero(np.diff(signal)) for signal in (x, y)) < FEWEST_MOVES:
        return 0.0
    return _greatest(new_x, new_y, left_out=LEFT_OUT)


def _centred(x: FloatArray) -> FloatArray:
    return x - x.mean()


def _greatest(x: FloatArray, y: FloatArray, left_out: int = 0) -> float:
    """The correlation of x and y (.., n), one up to SCANS_APART later or earlier, where it is greatest."""
    lags = range(-SCANS_APART, SCANS_APART + 1)
    return max(_correlation(*apart(x, y, later), left_out=left_out) for later in lags)


def _correlation(x: FloatArray, y: FloatArray, left_out: int = 0) -> float:
    """Size of the correlation of signals of mean 0, without so many samples whose product is greatest."""
    x, y = x.ravel(), y.ravel()
    kept = np.argsort(np.abs(x * y), kind="stable")[: len(x) - left_out]
    norm = float(np.linalg.norm(x[kept]) * np.linalg.norm(y[kept]))
    return abs(float(x[kept] @ y[kept])) / norm if norm > 0.0 else 0.0
