"""PV that holds one value up to the end of a recording while OP travels: a dead transmitter, or a stuck valve.

Judged on the newest samples, however much of the recording was recorded before them, and by how far OP went meanwhile,
not by their number: behind a live transmitter PV moves long before that.
"""

from dataclasses import dataclass

import numpy as np

from app.engine.evidence import in_digits
from app.engine.fitness.config import FitnessConfig
from app.engine.fitness.resample import lasting
from app.engine.fitness.samples import Samples
from app.engine.fitness.signals import at_extremes, at_limits, resolution
from app.engine.recording import BoolArray, FloatArray, IntArray, Recording, known_span
from app.engine.signals.sampled import blocks

MOST_BRIEF = 30
"""Samples that may lie between two stands, as while a transmitter is started again."""

MOST_STANDS = 6
"""Stands, the newest of them, that are looked at."""

FURTHER = 3.0
"""Times as far as OP ever went before while PV held one value, but for ODD such times: nothing answers any more."""

ODD, FEW = 2, 20
"""Of so many values that PV held before those in which OP went furthest are not held for usual: PV may have been dead
before, and be dead again.
"""

NEAREST, NEAREST_UNCOMPARED = 0.6, 2.0
"""Of PV's least step: so near to SP it is at its set point, as nearly as it can be stored; the latter where nothing was
recorded before that tells how PV moves."""

AWAY_SHARE = 0.5
"""Of the time of the newest stand SP is away from PV."""

LIMIT_SHARE = 0.5
"""Of the time of the newest stand OP is at its limit, where SP is not away."""


MOSTLY_RECORDED = 0.9
"""Of the time that PV stands: where less of it was recorded, how much is told."""


@dataclass(frozen=True)
class Standstill:
    """since_s: when PV came to stand, s from the recording's start. for_s: for how long, up to the end, s.
    recorded_s: how much of that was recorded, holes left out, s.

    levels: values that PV held one after the other. from_start: whether it stood when the recording began.
    wound_up: whether OP ends at its own extreme.
    """

    since_s: float
    for_s: float
    recorded_s: float
    levels: int
    from_start: bool
    wound_up: bool

    @property
    def text(self) -> str:
        """As a sentence begins."""
        told = "one value" if self.levels == 1 else f"{self.levels} values, one after another,"
        longer = " or longer" if self.from_start else ""
        ends = "was at its limit" if self.wound_up else "moved"
        holed = self.recorded_s < MOSTLY_RECORDED * self.for_s
        recorded = f", of which {in_digits(self.recorded_s / 3600.0, 3)} h were recorded," if holed else ","
        held = f"PV has held {told} for the last {in_digits(self.for_s / 3600.0, 3)} h{longer}"
        return f"{held}{recorded} up to the end, while OP {ends}"


def standstill(samples: Samples, recording: Recording, config: FitnessConfig) -> Standstill | None:
    """Since when PV stands and does not answer OP, up to the end of a recording; None where it moves, or has reasons.

    samples: of the recording, those that are looked at.

    It answers nothing where OP, with `config.fewest_moves` values or more, goes over so much that PV always moved
    before (FURTHER, `config.least_move`), while SP is away from PV by more than PV's least step, or, where it is not,
    OP ends at its limit. Some values one after the other are one stand, if little lies between them: a transmitter that
    is started again. Reasons are: out of automatic at the end, OP at rest (a unit that is shut down), PV at its set
    point, OP that went no further than before while PV held a value (coarse or compressed values). Where PV stands from
    beginning to end, and OP at an end of its known span for as long, SP away from PV in automatic is enough, if PV is
    not at an end of its own. Misleads where a unit is shut down with its loops in automatic.
    """
    if len(samples) < config.least_still or (samples.automatic is not None and not samples.automatic[-1]):
        return None
    starts = _starts(samples.pv)
    stands = _newest_stands(starts, len(samples), _automatic_from(samples.automatic), config.least_still)
    if not stands:
        return None
    first = _first_unanswered(samples, starts, stands, config)
    if first is not None:
        stands = [one for one in stands if one.start >= first]
        at_work = _at_work(samples, starts, stands, config.least_still)
    else:
        at_work = _wound_up_throughout(samples, stands, recording, config.op_limit_band)
    return _found(samples, float(recording.time_s[0]), stands, config) if at_work else None


def _starts(pv: FloatArray) -> IntArray:
    """The first samples of the runs in which PV (N,) holds one value."""
    moved = np.abs(np.diff(pv)) > resolution(pv)
    return np.concatenate(([0], np.flatnonzero(moved) + 1))


def _automatic_from(automatic: BoolArray | None) -> int:
    """The first sample of the spell in automatic that goes up to the end."""
    if automatic is None or automatic.all():
        return 0
    return int(np.flatnonzero(~automatic)[-1]) + 1


def _newest_stands(starts: IntArray, n: int, since: int, least: int) -> list[slice]:
    """The stands of so many samples at least up to the end, in order of time, since a sample; empty where PV moves at
    the end.
    """
    found: list[slice] = []
    brief, last = 0, n
    for start in starts[::-1].tolist():
        length = last - max(start, since)
        if length >= least:
            found.append(slice(max(start, since), last))
            brief = 0
        else:
            brief += length
        last = start
        if brief > MOST_BRIEF or len(found) == MOST_STANDS or last <= since:
            break
    return found[::-1]


def _first_unanswered(samples: Samples, starts: IntArray, stands: list[slice], config: FitnessConfig) -> int | None:
    """The first sample of the first of these stands in which OP went where PV always moved before."""
    op = samples.op
    ranges = np.maximum.reduceat(op, starts) - np.minimum.reduceat(op, starts)
    for stand in stands:
        # The run that it stands in may have begun earlier, out of automatic: it is none of those before.
        own = int(np.searchsorted(starts, stand.start, side="right")) - 1
        usual, went = _usual(ranges[:own]), float(np.ptp(op[stand]))
        if went <= max(FURTHER * usual, resolution(op)) or not as_far_as_ever(op[: stand.start], op[stand], config):
            continue
        if len(np.unique(op[stand])) >= config.fewest_moves:
            return stand.start
    return None


def _usual(ranges: FloatArray) -> float:
    """The greatest of these, but for ODD where they are many."""
    if len(ranges) < FEW:
        return float(np.max(ranges, initial=0.0))
    return float(np.partition(ranges, -1 - ODD)[-1 - ODD])


def as_far_as_ever(before: FloatArray, since: FloatArray, config: FitnessConfig) -> bool:
    """Whether OP goes over at least a share of what it went `before` (M,) in such a time, in what is `since` (N,)."""
    if len(before) < max(config.least_still, 1):
        return True
    usual = float(np.median(np.ptp(blocks(before, min(len(since), len(before))), axis=1)))
    return float(np.ptp(since)) >= config.least_move * usual


def _at_work(samples: Samples, starts: IntArray, stands: list[slice], least_still: int) -> bool:
    """Whether something is left to do in the newest stand: PV is away from its set point, or OP at its limit. Where PV
    moved coarsely at best, and never but from stand to stand, it has to be one or the other more clearly.
    """
    newest, compared = stands[-1], stands[0].start >= least_still
    if samples.sp is None or not (known := np.isfinite(samples.sp[newest])).any():
        return compared or len(stands) == 1 or _wound_up(samples.op, newest)
    distance = np.abs(samples.sp[newest][known] - samples.pv[newest][known])
    near = (NEAREST if compared else NEAREST_UNCOMPARED) * _least_step(samples.pv, starts)
    if float(np.mean(distance > near)) >= AWAY_SHARE:
        return True
    moved = samples.sp[max(newest.start - least_still, 0) :]
    return _wound_up(samples.op, newest) and float(np.ptp(moved[np.isfinite(moved)])) <= resolution(samples.pv)


def _least_step(pv: FloatArray, starts: IntArray) -> float:
    steps = np.abs(pv[starts[1:]] - pv[starts[1:] - 1])
    return max(float(np.min(steps)), resolution(pv)) if len(steps) else resolution(pv)


def _wound_up(op: FloatArray, part: slice) -> bool:
    low, high = at_extremes(op)
    return max(float(np.mean(low[part])), float(np.mean(high[part]))) >= LIMIT_SHARE


def _wound_up_throughout(samples: Samples, stands: list[slice], recording: Recording, band: float) -> bool:
    """Whether PV stands from beginning to end and OP at an end of its span, in automatic, with SP away."""
    span = known_span(recording.pv_range)
    limits = at_limits(samples.op, recording.op_range, band)
    ends = at_limits(samples.pv, recording.pv_range, band)
    if samples.automatic is None or samples.sp is None or span is None or limits is None or ends is None:
        return False
    throughout = stands[0].start <= MOST_BRIEF and max(float(np.mean(side)) for side in limits) == 1.0
    if not throughout or not samples.automatic.all() or bool(np.any(ends[0] | ends[1])):
        return False
    away = np.abs(np.nan_to_num(samples.sp - samples.pv)) > band * (span[1] - span[0])
    return float(np.mean(away)) >= AWAY_SHARE


def _recorded_s(time_s: FloatArray, first: int, max_gap_intervals: float) -> float:
    """Of the time from a sample on, without holes, s; time_s: (N,) s, N > 1."""
    intervals = np.diff(time_s)
    filled = intervals <= lasting(max_gap_intervals, time_s)
    return float(np.sum(intervals[first:], where=filled[first:]))


def _found(samples: Samples, origin_s: float, stands: list[slice], config: FitnessConfig) -> Standstill:
    first, time_s = stands[0].start, samples.time_s
    return Standstill(
        since_s=float(time_s[first]) - origin_s,
        for_s=float(time_s[-1] - time_s[first]),
        recorded_s=_recorded_s(time_s, first, config.max_gap_intervals),
        levels=len(stands),
        from_start=first <= MOST_BRIEF,
        wound_up=_wound_up(samples.op, stands[-1]),
    )
