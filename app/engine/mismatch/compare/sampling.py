"""PV that was taken once an interval and held until the next time: found in PV alone, compared at these instants."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.mismatch.compare.comparison import Comparison, record_of, shortened
from app.engine.mismatch.loop.experiment import Experiment, Finer, alike
from app.engine.recording import BoolArray, FloatArray, IntArray

_LEAST_MOVES, _LEAST_VALUES = 20, 10
_SHORTEST = 1.4  # samples: below, PV repeats itself too rarely to show a hold
_LATE = 0.1  # of the interval: how far a change may be off its instant, beyond the sample that shows it
_ON_TIME, _MOVED = 0.93, 0.7
_JITTERED = 4.0  # samples: intervals from which on a scan may come a sample late
_RESTS = 5  # intervals: a longer rest is the end of a range, or a stuck sensor
_MOST_SIMULATED = 8000  # samples: beyond, OP's means over the intervals are simulated


@dataclass(frozen=True, eq=False)
class _Hold:
    """Equal intervals between which PV stands still. interval, first: in samples, the instants are first + m interval;
    shown: (M,) the sample that shows PV as it was taken at each; moves: how often PV changed.
    """

    interval: float
    first: float
    shown: IntArray
    moves: int

    @property
    def instants(self) -> FloatArray:
        return self.first + self.interval * np.arange(len(self.shown), dtype=np.float64)


def hold_of(pv: FloatArray, known: BoolArray | None = None) -> _Hold | None:
    """At which instants PV (N,) was taken; None where it changes at irregular times, or with nearly every sample.

    The changes of PV must fall on instants, and most instants change it, long rests aside: what is compressed changes
    when it has moved far enough, what is quantised when it crosses a level. known: (N,) False where PV was filled in.
    """
    moved = np.diff(pv) != 0.0
    at = np.flatnonzero(moved if known is None else moved & known[1:] & known[:-1]) + 1
    if len(at) < _LEAST_MOVES or len(np.unique(pv)) < _LEAST_VALUES:
        return None
    rough = _usual_spacing(np.diff(at))
    if rough < _SHORTEST:
        return None
    count, kept = _counted(at, rough)
    if kept.sum() < _LEAST_MOVES:
        return None
    interval = _whole_or_not(float(np.polyfit(count[kept], at[kept], 1)[0]), int(count[-1]))
    beside = at - interval * count
    on_time = kept & (np.abs(beside - np.median(beside[kept])) <= _lateness(interval))
    passed = np.diff(count[on_time])
    few = np.sum(passed <= _RESTS) < _MOVED * np.sum(passed[passed <= _RESTS])
    if interval < _SHORTEST or np.mean(on_time) < _ON_TIME or few:
        return None
    return _laid(at[on_time], count[on_time], interval, float(np.min(beside[on_time])), len(pv))


def _usual_spacing(between: IntArray) -> float:
    """The mean of the spacings (M,) about their median; about the less of the two middle ones where the median lies
    between two that are far apart, and none is near it.
    """

    def about(usual: float) -> IntArray:
        return between[np.abs(between - usual) < max(0.5 * usual, 1.5)]

    near = about(float(np.median(between)))
    return float(np.mean(near if len(near) else about(float(np.quantile(between, 0.5, method="lower")))))


def _counted(at: IntArray, interval: float) -> tuple[IntArray, BoolArray]:
    """How many intervals from the first change each change (M,) is, from one that came on time to the next; and which
    did: a stray one in between counts for none.
    """
    count, kept = np.zeros(len(at), dtype=np.int64), np.zeros(len(at), dtype=np.bool_)
    before, reached, late = float(at[0]), 0, min(2.0 * _lateness(interval), 0.5 * interval)
    kept[0] = True
    for k, change in enumerate(at.tolist()):
        more = round((change - before) / interval)
        count[k] = reached + more
        if more > 0 and abs(change - before - more * interval) <= late:
            before, reached, kept[k] = change, reached + more, True
    return count, kept


def _lateness(interval: float) -> float:
    """How far a change may be off its instant, in samples; of long intervals a whole sample, as a scan comes late."""
    return max(0.5 * (1.0 + _LATE * interval), 1.0 if interval >= _JITTERED else 0.0)


def _whole_or_not(interval: float, count: int) -> float:
    """The interval, in whole samples where `count` of them are no sample apart from that."""
    return float(round(interval)) if abs(interval - round(interval)) * count < 1.0 else interval


def _laid(at: IntArray, count: IntArray, interval: float, first: float, samples: int) -> _Hold:
    """The hold whose changes `at` (M,) are at these counts of intervals from `first`, from the instant that is nearest
    to the record's start on.
    """
    before = int(np.round(first / interval))
    begin = first - before * interval
    instants = begin + interval * np.arange(max(int((samples - 1 - begin) / interval), before + int(count[-1])) + 1)
    shown = np.clip(np.ceil(instants), 0, samples - 1).astype(np.int64)
    shown[before + count] = at
    return _Hold(interval, begin, shown, len(at))


def _at_instants(comparison: Comparison, hold: _Hold) -> Comparison:
    """The comparison at the instants of a hold: PV as it was taken; OP, what it follows and measured causes as means
    until the next, so that a process with this OP is where it was, and the controller's law stays one.
    """

    def until_next(signal: FloatArray) -> FloatArray:
        return _means_from(signal, hold.instants, hold.interval)

    def at_them(signal: FloatArray) -> FloatArray:
        return np.interp(hold.instants, np.arange(len(signal)), signal)

    shown = hold.shown
    return comparison.through(
        until_next, lambda pv: pv[shown], lambda known: known[shown], sp=until_next, trace=at_them, times=hold.interval
    )


@dataclass(frozen=True, eq=False)
class Taken:
    """A comparison at the instants of a hold, beside it as it was sampled."""

    comparison: Comparison
    sampled: Comparison
    hold: _Hold

    @property
    def interval_s(self) -> float:
        return self.comparison.sampling_interval_s

    @property
    def first_s(self) -> float:
        """The first instant, s from the first sample; less than 0 where that shows what was taken before it."""
        return self.hold.first * self.sampled.sampling_interval_s

    def timed(self, record: Experiment) -> Experiment:
        """The record of the comparison, by the clock of the recording, which may end before the last interval does."""
        recorded_s = len(self.sampled.pv) * self.sampled.sampling_interval_s
        return replace(record, first_s=self.first_s, recorded_s=recorded_s)

    def simulated_between(self, record: Experiment) -> Experiment:
        """The record of the comparison, simulated along OP as it was sampled where that is no longer than can be."""
        if len(self.sampled.pv) > _MOST_SIMULATED:
            return record
        return replace(record, finer=Finer(alike(record, record_of(self.sampled)), self.hold.shown))


def taken_of(comparison: Comparison) -> Taken | None:
    """The comparison where PV was taken; None where it is not held."""
    hold = hold_of(comparison.pv, comparison.known)
    return None if hold is None else Taken(_at_instants(comparison, hold), comparison, hold)


def _means_from(signal: FloatArray, instants: FloatArray, interval: float) -> FloatArray:
    """Means (M,) of a signal (N,), each sample held until the next, over an interval from each instant (M,), in
    samples; before its start it has its first value, after its end its last.
    """
    sums = np.concatenate(([0.0], np.cumsum(signal - signal[0])))

    def until(end: FloatArray) -> FloatArray:
        beyond = np.maximum(end - len(signal), 0.0)
        return np.interp(end, np.arange(len(sums)), sums) + beyond * (signal[-1] - signal[0])

    return signal[0] + (until(instants + interval) - until(instants)) / interval


def as_compared(comparison: Comparison, taken: Taken | None) -> Comparison:
    """The comparison where PV was taken, and no longer than can be fitted."""
    return shortened(comparison if taken is None else taken.comparison)
