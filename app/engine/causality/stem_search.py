"""What PV tells beyond a linear loop, made ready for asking whether the stem of a valve foretells it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from app.engine.causality.foretelling import Lags, Table, fitted, not_far
from app.engine.fitness.signals import STANDING, newest_long_run, standing, stored_points
from app.engine.recording import BoolArray, FloatArray, UniformRecord
from app.engine.signals.sampled import gathered
from app.engine.signals.turning import usual_range

MOST_SAMPLES = 40_000
"""The newest of these are enough, and their tables have 40 MB."""

STRIDES = (2, 5, 12)
ORDER, STEM_ORDER = 24, 4
"""How many of the last means of PV and OP are looked at, and of a stem: with fewer of PV and OP a line of the load's is
taken for a band, because the stem tells of an OP further back."""

SETTLING = 5 * ORDER
"""Means after a move of the set point that are left out, if half of the record is left: PV and OP move far then, and
show more than all else what a linear model lacks."""

AFTER_UPSET = 8
"""Means after one that is missed by far that are left out too."""

NEWS_ORDER, USUAL = 8, 1.5
"""How many of the last means of the news are looked at, and how many standard deviations of it are usual: under noise
of heavy tails what is rare is worth less than a linear loop makes of it, and a stem, which passes the great moves of
OP alone, would tell that."""

NORMAL = 1.4826
"""Standard deviation of a normal miss over its median."""

PARTS = 3


@dataclass(frozen=True, eq=False)
class Asked:
    """One stride of a record: the means of PV that are foretold (kept, of those that `lags` has) and what is known of
    them without a valve that sticks.
    """

    lags: Lags
    kept: BoolArray
    known: Table

    @property
    def means(self) -> int:
        return self.known.values

    def needed(self, tried: int) -> float:
        """Nats that the best of so many signals is worth by chance (Schwarz 1978, doi 10.1214/aos/1176344136)."""
        return float(0.5 * STEM_ORDER * np.log(self.means) + np.log(tried))

    def most_worth(self, signals: FloatArray) -> tuple[int, FloatArray]:
        """Which of the signals (M, N) foretells PV best beside what is known, by its past, and its nats (PARTS,); those
        that stand are worth nothing.
        """
        nats = np.zeros((len(signals), PARTS))
        moves = np.ptp(signals, axis=1) > 0.0
        if moves.any():
            nats[moves] = self.known.worths(self._past(signals[moves]))
        best = int(np.argmax(nats.sum(axis=1)))
        return best, nats[best]

    def beside(self, signals: FloatArray) -> "Asked":
        """With the past of the one of the signals (M, N) that foretells PV best known too, if one does."""
        best, nats = self.most_worth(signals)
        if not nats.sum() > 0.0:
            return self
        return replace(self, known=self.known.beside(self._past(signals[best : best + 1])[0]))

    def _past(self, signals: FloatArray) -> FloatArray:
        return gathered(self.lags.past(signals, STEM_ORDER), np.flatnonzero(self.kept))


def moving_part(record: UniformRecord) -> UniformRecord | None:
    """The longest stretch in which nothing stands, less what is needed to forget the standstill; the newest of it. None
    where nothing moves.
    """
    moving = record.part(_longest_moving(record))
    if not moving.samples or not usual_range(moving.op) > 0.0 or not usual_range(moving.pv) > 0.0:
        return None
    return moving


def asked_of(moving: UniformRecord) -> Iterator[Asked]:
    """On each stride on which something can be told of a part that moves: where PV and OP were stored once a mean or
    oftener, of what upsets do not touch. The coarsest comes first, which costs least.
    """
    stored = min(stored_points(moving.pv), stored_points(moving.op))
    news = _usual_news(moving)
    for lags in (Lags(stride, ORDER) for stride in reversed(STRIDES) if stride * stored >= moving.samples):
        if not lags.fit_in(moving.samples):
            continue
        rows = _linear(lags, moving, news)
        kept = _undisturbed(lags, moving, rows)
        if np.count_nonzero(kept) >= lags.fewest:
            known = Table.in_parts(np.compress(kept, rows, axis=1), PARTS)
            if not known.foretells_all:
                yield Asked(lags, kept, known)


def _longest_moving(record: UniformRecord) -> slice:
    stands = standing(record.pv, record.op) >= STANDING
    if not stands.any():
        return slice(max(record.samples - MOST_SAMPLES, 0), record.samples)
    longest, margin = newest_long_run(~stands, 1.0, 0), SETTLING * STRIDES[0]
    start, end = longest.start + margin, longest.stop - margin
    return slice(max(start, end - MOST_SAMPLES), max(start, end))


def _linear(lags: Lags, record: UniformRecord, news: FloatArray) -> FloatArray:
    """What is known of each mean of PV without a valve that sticks, and that mean as the last row."""
    signals = [record.pv, record.op]
    if record.sp is not None and np.ptp(record.sp) > 0.0:
        signals.append(record.sp)
    past = [part for x in signals for part in lags.all_past(x)]
    return np.vstack((lags.ones(record.pv), *past, lags.past(news, NEWS_ORDER), lags.value(record.pv)))


def _usual_news(record: UniformRecord) -> FloatArray:
    """(N,): what is new in each sample of PV, cut at what is usual of it; zero where too little is recorded."""
    lags, news = Lags(1, ORDER), np.zeros(record.samples)
    if not lags.fit_in(record.samples):
        return news
    past = [lags.past(x, ORDER) for x in (record.pv, record.op)]
    missed = _missed(np.vstack((lags.ones(record.pv), *past, lags.value(record.pv))))
    usual = USUAL * NORMAL * float(np.median(np.abs(missed)))
    news[ORDER:] = np.clip(missed, -usual, usual)
    return news


def _undisturbed(lags: Lags, record: UniformRecord, linear: FloatArray) -> BoolArray:
    """Which means are neither after a move of the set point nor at or after an upset."""
    kept = np.ones(linear.shape[1], bool)
    if record.sp is not None:
        after = lags.touched(np.diff(record.sp, prepend=record.sp[0]) != 0.0, SETTLING)
        kept = ~after if 2 * np.count_nonzero(after) <= len(after) else kept
    upset = np.zeros(len(kept), bool)
    upset[kept] = ~not_far(_missed(np.compress(kept, linear, axis=1)))
    for late in range(AFTER_UPSET + 1):
        kept[late:] &= ~upset[: len(upset) - late]
    return kept


def _missed(rows: FloatArray) -> FloatArray:
    """(n,): what the rows (k, n) but the last do not explain of it."""
    return np.asarray(rows[-1] - fitted(rows @ rows.T, len(rows) - 1) @ rows[:-1])
