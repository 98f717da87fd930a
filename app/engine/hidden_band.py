"""A band in which the valve sticks: PV shows it, though no shape does, where the loop hardly cycles for it; and a loop
that cycles for it shows it too, or its cycle is made elsewhere.

What noise and load make of OP moves the stem of such a valve too, a part of each movement less, and PV goes by the
stem. Over thousands of samples that can be told from a valve which follows: the stem that a valve of the right size
would have foretells PV beyond what the past of PV, OP and SP does.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from app.engine.fitness.signals import STANDING, newest_long_run, standing, stored_points
from app.engine.foretelling import Lags, Table, fitted, not_far
from app.engine.recording import BoolArray, FloatArray, UniformRecord
from app.engine.turning import relays, stems, usual_range

MOST_SAMPLES = 40_000
"""The newest of these are enough, and their tables have 20 MB."""

STRIDES = (2, 5, 12)
ORDER, STEM_ORDER = 24, 4
"""How many of the last means of PV and OP are looked at, and of a stem: with fewer of PV and OP a line of the load's is
taken for a band, because the stem tells of an OP further back."""

SETTLING = 5 * ORDER
"""Means after a move of the set point that are left out, if half of the record is left: PV and OP move far then, and
show more than all else what a linear model lacks."""

AFTER_UPSET = 8
"""Means after one that is missed by far that are left out too."""

SIZES = np.geomspace(0.03, 0.6, 8)
"""S over the range of OP. A valve that is called healthy has a band too: what is below is none to ask for."""

NEWS_ORDER, USUAL = 8, 1.5
"""How many of the last means of the news are looked at, and how many standard deviations of it are usual: under noise
of heavy tails what is rare is worth less than a linear loop makes of it, and a stem, which passes the great moves of
OP alone, would tell that."""

NORMAL = 1.4826
"""Standard deviation of a normal miss over its median."""

PARTS = 3

TELLING = 1000
"""Means from which a valve whose loop cycles for its band would show it: of 242 simulated ones that are called sticky
reliably by all else 3 do not; of 117 healthy ones that are, shaken by triangles, 48 do not."""

_NOTHING = np.zeros(PARTS)


@dataclass(frozen=True)
class HiddenBand:
    """S: of the valve whose stem foretells PV best, unit of OP; one of eight sizes, each half as large again as the one
    before. nats: what it is worth by likelihood. needed: what as many terms and valves as were tried are worth by
    chance.
    """

    S: float
    nats: float
    needed: float


@dataclass(frozen=True)
class Search:
    """What came of looking for a band. found: the one that PV shows all the time, or None. by_itself: whether one is
    shown beside what PV tells of loads that switch. hinted: whether it is so in the record as a whole, if not all the
    time. means: how many of PV were looked at, at most.
    """

    found: HiddenBand | None = None
    by_itself: bool = False
    hinted: bool = False
    means: int = 0

    @property
    def in_vain(self) -> bool:
        """Whether a valve that makes its loop cycle would have been seen."""
        return self.means >= TELLING and not self.hinted


@dataclass(frozen=True)
class _Best:
    """The best of the bands, and whether it has its share in each part."""

    band: HiddenBand
    all_the_time: bool

    @property
    def pays(self) -> float:
        return self.band.nats - self.band.needed

    @property
    def shown(self) -> bool:
        return self.all_the_time and self.pays > 0.0


@dataclass(frozen=True)
class _Tried:
    """What one stride told, of so many means. beside: what is left beside the rivals; None where nothing is."""

    means: int
    best: _Best
    beside: _Best | None


@dataclass(frozen=True, eq=False)
class _Moving:
    """What of a record moves, and what a valve that sticks would make of it."""

    record: UniformRecord

    @property
    def strides(self) -> tuple[int, ...]:
        """Those on which something can be told; none where PV or OP stands."""
        if not self.record.samples or not self.op_range > 0.0 or not usual_range(self.record.pv) > 0.0:
            return ()
        stored = min(stored_points(self.record.pv), stored_points(self.record.op))
        return tuple(stride for stride in STRIDES if stride * stored >= self.record.samples)

    @property
    def op_range(self) -> float:
        return usual_range(self.record.op)

    @cached_property
    def stems(self) -> FloatArray:
        """(M, N), over the range of OP."""
        return stems(self.record.op, SIZES)

    @cached_property
    def rivals(self) -> tuple[FloatArray, ...]:
        """(M, N) each."""
        error = self.record.pv - (np.median(self.record.pv) if self.record.sp is None else self.record.sp)
        return stems(self.record.pv, SIZES), relays(error, SIZES)


def look_for_band(record: UniformRecord) -> Search:
    """The band that PV shows; none is found where too little is recorded, too.

    On each stride the stems of valves of many sizes, moved by OP, are tried beside the past of PV, OP and SP. The best
    one has to be worth more than its terms (Schwarz 1978, doi 10.1214/aos/1176344136) and than the number of those
    tried, and worth its share of that in each third of the record: a band is the valve's and stays, an upset is over.
    Asked of what upsets do not touch, and only where PV and OP were stored once a mean or oftener.

    Then it is asked whether one is shown beside what PV itself tells of a load that goes one way for a while and then
    the other, as a pump, a batch or a neighbour's valve makes it: by how much PV has turned, and on which side of the
    set point it is. A stem tells that too, because it turns where OP does.

    Misleads: loads that switch to and fro show as a band, a few by itself, and so may what else a linear model lacks
    all the time. A band in which noise alone moves OP is hardly shown by itself where OP is PV times a gain.
    Source: the valves are Kano's (Kano et al. 2004, Practical model and detection algorithm for valve stiction).
    """
    moving = _Moving(record.part(_longest_moving(record)))
    strides = moving.strides
    if not strides:
        return Search()
    news = _usual_news(moving.record)
    on_each = (_on(Lags(stride, ORDER), moving, news) for stride in strides)
    tried = [one for one in on_each if one is not None]
    shown = [one.best for one in tried if one.best.shown]
    beside = [one.beside for one in tried if one.beside is not None]
    best = max(shown, key=lambda one: one.pays).band if shown else None
    return Search(
        found=None if best is None else replace(best, S=moving.op_range * best.S),
        by_itself=any(one.shown for one in beside),
        hinted=any(one.pays > 0.0 for one in beside),
        means=max((one.means for one in tried), default=0),
    )


def _longest_moving(record: UniformRecord) -> slice:
    """The longest stretch in which nothing stands, less what is needed to forget the standstill; the newest of it."""
    stands = standing(record.pv, record.op) >= STANDING
    if not stands.any():
        return slice(max(record.samples - MOST_SAMPLES, 0), record.samples)
    longest, margin = newest_long_run(~stands, 1.0, 0), SETTLING * STRIDES[0]
    start, end = longest.start + margin, longest.stop - margin
    return slice(max(start, end - MOST_SAMPLES), max(start, end))


def _on(lags: Lags, moving: _Moving, news: FloatArray) -> _Tried | None:
    """news: of PV. S of what is tried is in the unit of SIZES."""
    if not lags.fit_in(moving.record.samples):
        return None
    rows = _linear(lags, moving.record, news)
    kept = _undisturbed(lags, moving.record, rows)
    if np.count_nonzero(kept) < lags.fewest:
        return None
    linear = Table.in_parts(rows[kept], PARTS)
    if linear.foretells_all:
        return None
    means, best = len(linear.rows), _best(lags, kept, linear, moving.stems)
    if best.pays <= 0.0:
        return _Tried(means, best, None)
    for rival in moving.rivals:
        linear = linear.beside(lags.past(rival[_of_most_worth(lags, kept, linear, rival)[0]], STEM_ORDER)[kept])
    return _Tried(means, best, None if linear.foretells_all else _best(lags, kept, linear, moving.stems))


def _best(lags: Lags, kept: BoolArray, known: Table, stems: FloatArray) -> _Best:
    best, nats = _of_most_worth(lags, kept, known, stems)
    needed = float(0.5 * STEM_ORDER * np.log(len(known.rows)) + np.log(len(stems)))
    return _Best(HiddenBand(float(SIZES[best]), float(nats.sum()), needed), bool(PARTS * nats.min() > needed))


def _of_most_worth(lags: Lags, kept: BoolArray, known: Table, signals: FloatArray) -> tuple[int, FloatArray]:
    """Which of the signals (M, N) foretells PV best beside what is known, and its nats (PARTS,)."""
    nats = np.array([known.worth(lags.past(x, STEM_ORDER)[kept]) if np.ptp(x) > 0.0 else _NOTHING for x in signals])
    best = int(np.argmax(nats.sum(axis=1)))
    return best, nats[best]


def _linear(lags: Lags, record: UniformRecord, news: FloatArray) -> FloatArray:
    """What is known of each mean of PV without a valve that sticks, and that mean as the last column."""
    signals = [record.pv, record.op]
    if record.sp is not None and np.ptp(record.sp) > 0.0:
        signals.append(record.sp)
    past = [part for x in signals for part in (lags.whole_past(x), lags.long_past(x))]
    return np.column_stack((lags.ones(record.pv), *past, lags.past(news, NEWS_ORDER), lags.value(record.pv)))


def _usual_news(record: UniformRecord) -> FloatArray:
    """(N,): what is new in each sample of PV, cut at what is usual of it; zero where too little is recorded."""
    lags, news = Lags(1, ORDER), np.zeros(record.samples)
    if not lags.fit_in(record.samples):
        return news
    past = [lags.past(x, ORDER) for x in (record.pv, record.op)]
    table = np.column_stack((lags.ones(record.pv), *past, lags.value(record.pv)))
    missed = table[:, -1] - table[:, :-1] @ fitted(table.T @ table, table.shape[1] - 1)
    usual = USUAL * NORMAL * float(np.median(np.abs(missed)))
    news[ORDER:] = np.clip(missed, -usual, usual)
    return news


def _undisturbed(lags: Lags, record: UniformRecord, linear: FloatArray) -> BoolArray:
    """Which rows are neither after a move of the set point nor at or after an upset."""
    kept = np.ones(len(linear), bool)
    if record.sp is not None:
        after = lags.touched(np.diff(record.sp, prepend=record.sp[0]) != 0.0, SETTLING)
        kept = ~after if 2 * np.count_nonzero(after) <= len(after) else kept
    rows = linear[kept]
    upset = np.zeros(len(linear), bool)
    upset[kept] = ~not_far(rows[:, -1] - rows[:, :-1] @ fitted(rows.T @ rows, rows.shape[1] - 1))
    for late in range(AFTER_UPSET + 1):
        kept[late:] &= ~upset[: len(upset) - late]
    return kept
