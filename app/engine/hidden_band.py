"""A band in which the valve sticks, where the loop hardly cycles for it: PV shows it, though no shape does.

What noise and load make of OP moves the stem of such a valve too, a part of each movement less, and PV goes by the
stem. Over thousands of samples that can be told from a valve which follows: the stem that a valve of the right size
would have foretells PV beyond what the past of PV, OP and SP does.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from app.engine.fitness.signals import STANDING, newest_long_run, standing, stored_points
from app.engine.foretelling import FORETOLD, Lags, fitted, not_far
from app.engine.recording import BoolArray, FloatArray, UniformRecord
from app.engine.sampled import quantiles
from app.engine.valve import kano_stems

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

JUMP = 0.2
"""J over S: what the stem slips little shows of valves that jump as well, and better than a large one of the others."""

NEWS_ORDER, USUAL = 8, 1.5
"""How many of the last means of the news are looked at, and how many standard deviations of it are usual: under noise
of heavy tails what is rare is worth less than a linear loop makes of it, and a stem, which passes the great moves of
OP alone, would tell that."""

NORMAL = 1.4826
"""Standard deviation of a normal miss over its median."""

PARTS = 3
_RANGE = (0.01, 0.99)


@dataclass(frozen=True)
class HiddenBand:
    """S: of the valve whose stem foretells PV best, unit of OP; one of eight sizes, each half as large again as the one
    before. nats: what it is worth by likelihood. needed: what as many terms and valves as were tried are worth by
    chance.
    """

    S: float
    nats: float
    needed: float


def hidden_band(record: UniformRecord) -> HiddenBand | None:
    """The band that PV shows; None where it shows none, or too little is recorded.

    On each stride the stems of valves of many sizes, moved by OP, are tried beside the past of PV, OP and SP. The best
    one has to be worth more than its terms (Schwarz 1978, doi 10.1214/aos/1176344136) and than the number of those
    tried, and worth its share of that in each third of the record: a band is the valve's and stays, an upset is over.
    Asked of what upsets do not touch, and only where PV and OP were stored once a mean or oftener.

    Misleads: loads that switch to and fro show as a band (a pump, a batch), and so may what else a linear model lacks
    all the time.
    Source: the valves are Kano's (Kano et al. 2004, Practical model and detection algorithm for valve stiction).
    """
    moving = record.part(_longest_moving(record))
    if not moving.samples:
        return None
    low, high = quantiles(moving.op, _RANGE)
    stored = min(stored_points(moving.pv), stored_points(moving.op))
    strides = [stride for stride in STRIDES if stride * stored >= moving.samples]
    if not strides or not high > low:
        return None
    op = (moving.op - moving.op[0]) * (_direction(moving.op) / (high - low))
    stems = np.empty((len(SIZES), len(op)))
    kano_stems(op, SIZES, JUMP * SIZES, stems)
    news = _usual_news(moving)
    found = [_on(Lags(stride, ORDER), replace(moving, op=op), stems, news) for stride in strides]
    shown = [band for band in found if band is not None]
    best = max(shown, key=lambda band: band.nats - band.needed, default=None)
    return None if best is None else replace(best, S=float(high - low) * best.S)


def _longest_moving(record: UniformRecord) -> slice:
    """The longest stretch in which nothing stands, less what is needed to forget the standstill; the newest of it."""
    stands = standing(record.pv, record.op) >= STANDING
    if not stands.any():
        return slice(max(record.samples - MOST_SAMPLES, 0), record.samples)
    longest, margin = newest_long_run(~stands, 1.0, 0), SETTLING * STRIDES[0]
    start, end = longest.start + margin, longest.stop - margin
    return slice(max(start, end - MOST_SAMPLES), max(start, end))


def _direction(op: FloatArray) -> float:
    """1 where OP rises first, -1 where it falls: a valve at rest knows one of them, and the sign of OP is free."""
    return float(np.sign(op[np.argmax(op != op[0])] - op[0]))


def _on(lags: Lags, record: UniformRecord, stems: FloatArray, news: FloatArray) -> HiddenBand | None:
    """news: of PV. S of what is found is in the unit of SIZES."""
    if not lags.fit_in(record.samples):
        return None
    linear = _linear(lags, record, news)
    terms = linear.shape[1] - 1
    kept = _undisturbed(lags, record, linear)
    linear = linear[kept]
    if len(linear) < lags.fewest:
        return None
    edges = [len(linear) * k // PARTS for k in range(PARTS + 1)]
    thirds = [slice(start, end) for start, end in pairwise(edges)]
    alone = _grams(linear, linear, thirds)
    missed = _missed(alone, terms)
    if missed.sum() <= FORETOLD * alone[:, -1, -1].sum():
        return None
    nats = np.zeros((len(stems), PARTS))
    for k, stem in enumerate(stems):
        if np.ptp(stem) > 0.0:
            beside = _beside(alone, linear, lags.past(stem, STEM_ORDER)[kept], thirds)
            nats[k] = _nats(missed, _missed(beside, terms + STEM_ORDER), thirds)
    best = int(np.argmax(nats.sum(axis=1)))
    needed = 0.5 * STEM_ORDER * np.log(len(linear)) + np.log(len(stems))
    if PARTS * nats[best].min() <= needed:
        return None
    return HiddenBand(float(SIZES[best]), float(nats[best].sum()), float(needed))


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


def _grams(a: FloatArray, b: FloatArray, parts: list[slice]) -> FloatArray:
    """(parts, columns of a, columns of b): their products over the rows of each part."""
    return np.array([a[part].T @ b[part] for part in parts])


def _beside(alone: FloatArray, linear: FloatArray, stem: FloatArray, parts: list[slice]) -> FloatArray:
    """The products of the linear terms, with the stem's past put before what PV is next."""
    size, more = alone.shape[1], stem.shape[1]
    linear_at = [*range(size - 1), size - 1 + more]
    stem_at = list(range(size - 1, size - 1 + more))
    grams = np.empty((len(parts), size + more, size + more))
    grams[np.ix_(range(len(parts)), linear_at, linear_at)] = alone
    grams[np.ix_(range(len(parts)), stem_at, stem_at)] = _grams(stem, stem, parts)
    across = _grams(linear, stem, parts)
    grams[np.ix_(range(len(parts)), linear_at, stem_at)] = across
    grams[np.ix_(range(len(parts)), stem_at, linear_at)] = across.transpose(0, 2, 1)
    return grams


def _missed(grams: FloatArray, terms: int) -> FloatArray:
    """(parts,): sums of squares that one fit to all parts leaves in each."""
    weights = np.append(-fitted(grams.sum(axis=0), terms), 1.0)
    return np.asarray(np.maximum(weights @ grams @ weights, 0.0))


def _nats(before: FloatArray, after: FloatArray, parts: list[slice]) -> FloatArray:
    """(parts,): by how much the logarithm of the likelihood of each part rises, under normal misses of one variance."""
    sizes = np.array([part.stop - part.start for part in parts])
    was, now = (max(float(missed.sum()), np.finfo(float).tiny) / sizes.sum() for missed in (before, after))
    return np.asarray(0.5 * (before / was - after / now) + 0.5 * sizes * np.log(was / now))
