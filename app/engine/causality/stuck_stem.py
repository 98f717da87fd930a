"""Whether the stem stands since some time: OP runs over many times what it did before, and PV answers it no more.

A stem that stops within a record leaves a record of two parts. In the first OP goes over a few per cent and PV answers
it; in the second the controller drives OP to and fro, mostly from limit to limit, after a PV that goes its own way.
"""

from dataclasses import dataclass

import numpy as np

from app.engine.causality.answering import goes_its_own_way
from app.engine.features.travel import reversals
from app.engine.fitness.signals import at_extremes
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import blocks, correlation, deviation, quantiles

LEAST_PART = 400
"""Samples before and since, at least: what each of them shows is known from some."""

WIDER = 3.0
"""Times as much as OP goes over before, in as long a time."""

USUAL = (0.05, 0.95)
"""Quantiles of OP before: where it leaves what is between them for good, PV answered it last."""

LEG, FEWEST_TURNS, FEWEST_TURNS_WITH_SP = 0.5, 3, 2
"""Share of OP's range after which it has turned, and its turns: one alone may be a load that is too large; where PV
leaves its set point alone fewer will do."""

AT_LIMITS = 0.25
"""Share of the time that OP is at either of its extremes: what nothing answers runs on until it is stopped."""

AT_ENDS = 0.1
"""Share of the time that PV is at one of its extremes, at most: a vessel that is full, or empty, answers nothing."""

ALIKE = 0.9
"""Share of PV's variance that is OP's, at most: of a controller of gain alone PV tells all that OP would."""

MOVED, FOLLOWS = 3.0, 0.3
"""SP moves by so many times the spread of the control error before, and PV goes along by less than this share."""

AWAY_SHARE, AWAY_AT_END, NEWEST = 0.5, 0.25, 300
"""Share of the later half, and of the newest samples, in which OP or PV is where it never was: else it is mended."""


@dataclass(frozen=True)
class StuckStem:
    """since_s: when PV answered last, s from the recording's start. for_s: for how long, up to the end, s.

    times: what OP goes over since, over what it went over before. sp_moved: whether PV left moves of SP alone.
    """

    since_s: float
    for_s: float
    times: float
    sp_moved: bool


def stuck_stem(record: UniformRecord) -> StuckStem | None:
    """Since when PV, which moves, does not answer OP any more; None where it does, or where that is not known.

    record: a stretch up to the end of a recording. PV has to have answered OP before, by `goes_its_own_way`, and has
    not to since; and OP runs to and fro over WIDER times as much, mostly between limits or while PV leaves SP alone,
    and PV or OP is where it never was, at the end too. Misleads where a load becomes many times as large and hides
    every answer; and says nothing of levels that run full, of slow control, whose PV is not seen to answer ever, nor
    where OP runs to one limit and stays there: that may be the load.
    """
    first = _departs(record.op)
    if first is None or not _astray(record, first):
        return None
    past, newest = record.part(slice(0, first)), record.part(slice(first, None))
    alone = _leaves_set_point_alone(past, newest)
    if not _runs_to_and_fro(newest, alone) or not goes_its_own_way(newest) or goes_its_own_way(past):
        return None
    times = float(np.ptp(newest.op)) / max(float(np.ptp(past.op)), 1e-9 * float(np.ptp(newest.op)))
    return StuckStem(newest.start_s, (newest.samples - 1) * record.sampling_interval_s, times, alone)


def _departs(op: FloatArray) -> int | None:
    """The sample at which OP leaves what it went over till then, for WIDER times as much in such a time; else None."""
    wide = np.maximum.accumulate(op) - np.minimum.accumulate(op)
    beyond = int(np.searchsorted(wide, wide[-1] / WIDER))
    if beyond < LEAST_PART or len(op) - beyond < LEAST_PART:
        return None
    low, high = quantiles(op[:beyond], USUAL)
    first = int(np.flatnonzero((op[:beyond] >= low) & (op[:beyond] <= high))[-1]) + 1
    if first < LEAST_PART:
        return None
    newest = op[first:]
    usual = float(np.median(np.ptp(blocks(newest, min(first, len(newest))), axis=1)))
    return first if usual >= WIDER * float(np.ptp(op[:first])) else None


def _astray(record: UniformRecord, first: int) -> bool:
    """Whether OP is far from where it was, or PV from its set point as never before: mostly, and at the end too."""
    op = record.op
    low, high = float(np.min(op[:first])), float(np.max(op[:first]))
    away = (op < low - (high - low)) | (op > high + (high - low))
    if record.sp is not None:
        error = np.abs(record.sp - record.pv)
        away |= error > np.max(error[:first])
    later = away[(first + len(away)) // 2 :]
    return float(np.mean(later)) >= AWAY_SHARE and float(np.mean(away[-NEWEST:])) >= AWAY_AT_END


def _runs_to_and_fro(newest: UniformRecord, leaves_set_point_alone: bool) -> bool:
    op, pv = newest.op, newest.pv
    fewest = FEWEST_TURNS_WITH_SP if leaves_set_point_alone else FEWEST_TURNS
    if _turns(op) < fewest or correlation(pv, op) ** 2 > ALIKE:
        return False
    if max(float(np.mean(side)) for side in at_extremes(pv)) > AT_ENDS:
        return False
    return leaves_set_point_alone or sum(float(np.mean(side)) for side in at_extremes(op)) >= AT_LIMITS


def _turns(op: FloatArray) -> int:
    """How often OP (N,) turns after a leg; in its own unit what is rounding to `reversals` could be all of it."""
    unit = float(deviation(op))
    return len(reversals(op / unit, LEG * float(np.ptp(op)) / unit)) if unit > 0.0 else 0


def _leaves_set_point_alone(past: UniformRecord, newest: UniformRecord) -> bool:
    if past.sp is None or newest.sp is None:
        return False
    moved = newest.sp - newest.sp.mean()
    power = float(moved @ moved)
    if power <= newest.samples * (MOVED * float(np.std(past.sp - past.pv))) ** 2:
        return False
    return abs(float(moved @ newest.pv)) < FOLLOWS * power
