"""A band in which the valve sticks, where the loop hardly cycles for it: PV shows it, though no shape does.

What noise and load make of OP moves the stem of such a valve too, a part of each movement less, and PV goes by the
stem. Over thousands of samples that can be told from a valve which follows: the stem that a valve of the right size
would have foretells PV beyond what the past of PV and of OP does.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from app.engine.fitness.signals import standing
from app.engine.foretelling import Lags, fitted, not_far
from app.engine.recording import BoolArray, FloatArray, UniformRecord
from app.engine.sampled import quantiles
from app.engine.valve import kano_stems

FEWEST_SAMPLES = 2000
"""In fewer it says too little: of 77 recordings with labels, most of them shorter, it speaks of 12 of 29 sticky ones
and of 7 of 48 healthy ones."""

STANDING = 300
"""Samples in a row of one value in PV or OP: the unit stands, and the record is looked at before it or after."""

STRIDES = (2, 5, 12)
ORDER, STEM_ORDER = 24, 4
"""How many of the last means of PV and OP are looked at, and of a stem: with fewer of PV and OP a line of the load's is
taken for a band, because the stem tells of an OP further back."""

SETTLING = 5 * ORDER
"""Means after a move of the set point that are left out, if half of the record is left: PV and OP move far then, and
show more than all else what a linear model lacks."""

SIZES = np.geomspace(0.03, 0.6, 8)
"""S over the range of OP. A valve that is called healthy has a band too: what is below is none to ask for."""

JUMP = 0.2
"""J over S: what the stem slips little shows of valves that jump as well, and better than a large one of the others."""

PARTS = 3
_RANGE = (0.01, 0.99)


@dataclass(frozen=True)
class HiddenBand:
    """S: of the valve whose stem foretells PV best, unit of OP. nats: what it is worth by likelihood. needed: what as
    many terms and valves as were tried are worth by chance.
    """

    S: float
    nats: float
    needed: float


def hidden_band(record: UniformRecord) -> HiddenBand | None:
    """The band that PV shows; None where it shows none, or too little is recorded.

    On each stride the stems of valves of many sizes, moved by OP, are tried beside the past of PV and of OP. The best
    one has to be worth more than its terms (Schwarz 1978, doi 10.1214/aos/1176344136) and than the number of those
    tried, and worth its share of that in each third of the record: a band is the valve's and stays, an upset is over.
    Asked of what upsets do not touch.

    Misleads: what a linear model lacks all the time may show as a band, as some lines of a load that swings do.
    Source: the valves are Kano's (Kano et al. 2004, Practical model and detection algorithm for valve stiction).
    """
    moving = _longest_moving(record)
    pv, op = record.pv[moving], record.op[moving]
    if len(pv) <= FEWEST_SAMPLES:
        return None
    low, high = quantiles(op, _RANGE)
    if not high > low:
        return None
    op = (op - op[0]) * (_direction(op) / (high - low))
    stems = np.empty((len(SIZES), len(op)))
    kano_stems(op, SIZES, JUMP * SIZES, stems)
    moves = _moves(None if record.sp is None else record.sp[moving], len(pv))
    found = [_on(Lags(stride, ORDER), pv, op, stems, moves) for stride in STRIDES]
    shown = [band for band in found if band is not None]
    best = max(shown, key=lambda band: band.nats - band.needed, default=None)
    return None if best is None else replace(best, S=(high - low) * best.S)


def _longest_moving(record: UniformRecord) -> slice:
    """The longest stretch in which nothing stands, less what is needed to forget the standstill."""
    stands = standing(record.pv, record.op) >= STANDING
    if not stands.any():
        return slice(0, record.samples)
    edges = np.flatnonzero(np.diff(np.concatenate(([True], stands, [True])).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    if not len(starts):
        return slice(0, 0)
    longest = int(np.argmax(ends - starts))
    margin = SETTLING * STRIDES[0]
    return slice(int(starts[longest]) + margin, max(int(ends[longest]) - margin, int(starts[longest]) + margin))


def _moves(sp: FloatArray | None, samples: int) -> BoolArray:
    """(samples,): where the set point is another one than before."""
    return np.zeros(samples, bool) if sp is None else np.diff(sp, prepend=sp[0]) != 0.0


def _direction(op: FloatArray) -> float:
    """1 where OP rises first, -1 where it falls: a valve at rest knows one of them, and the sign of OP is free."""
    return float(np.sign(op[np.argmax(op != op[0])] - op[0]))


def _on(lags: Lags, pv: FloatArray, op: FloatArray, stems: FloatArray, moves: BoolArray) -> HiddenBand | None:
    """moves: where the set point does. S of what is found is in the unit of SIZES."""
    if not lags.fit_in(len(pv)):
        return None
    past = (lags.own_past(pv), lags.past(op, ORDER), lags.long_past(pv), lags.long_past(op))
    linear = np.column_stack((*past, lags.value(pv)))
    terms = linear.shape[1] - 1
    kept = ~lags.touched(moves, SETTLING)
    kept = kept if 2 * np.count_nonzero(kept) >= len(kept) else np.ones(len(kept), bool)
    left = linear[kept]
    kept[kept] = not_far(left[:, -1] - left[:, :-1] @ fitted(left.T @ left, terms))
    linear = linear[kept]
    edges = [len(linear) * k // PARTS for k in range(PARTS + 1)]
    thirds = [slice(start, end) for start, end in pairwise(edges)]
    alone = _grams(linear, linear, thirds)
    missed = _missed(alone, terms)
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
