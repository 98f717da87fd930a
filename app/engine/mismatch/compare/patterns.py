"""Effects that PV shows by itself, before any simulation: repeated values, few levels, straight lines."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.compare.quiet import between_known, quiet_stretches, within_range
from app.engine.mismatch.compare.sampling import hold_of
from app.engine.mismatch.compare.widths import Width, band_of, door_of, unbounded
from app.engine.mismatch.fit.levels import level_spacing
from app.engine.mismatch.loop.block import Block, Part
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.physics.additive import LOAD_STEP
from app.engine.mismatch.physics.sample_hold import SAMPLE_HOLD
from app.engine.mismatch.physics.sensor_pattern import (
    COMPRESSION,
    DROPOUT,
    HELD,
    INTERPOLATED,
    LIMIT_HIGH,
    LIMIT_LOW,
    QUANTIZATION,
    STUCK,
)
from app.engine.recording import BoolArray, FloatArray, IntArray
from app.engine.signals.runs import runs_of

_LEAST_RUN = 10
_LEAST_AT_LIMIT, _LEAST_FREE = 12, 25
_STEP_OVER_NOISE = 1.0
_STEP_OVER_SPAN = 0.003
_STILL = 0.003
_STANDS_STILL = 1e-9  # of PV's span: what a value that is repeated moves
_NEAR_EXTREME = 0.02
_JUMP = 2.0
_MOST_STUCK = 5
_REGULAR, _HOLDS = 0.95, 0.4
_LOST_OR = (STUCK.code, LOAD_STEP.code)
LOST = 0.9
"""How sure a lost signal is. Where a process is about as fast as the samples are apart, a sensor that stuck in the
midst of a move looks the same if PV is elsewhere when it comes free: 17 of 1296 did, of which two thirds stuck where it
was meant to."""
FROZEN = 0.93
"""How sure a sensor that froze is. Noise may make it, and no repeated value does: of 903 simulated records without one
none showed it, so that 3.3 of 1000 do at most (95 %), and 83 % of those with one. Where one record of twenty has one,
at least 93 % of what is found is right."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """One effect found in PV itself: the part that models it, where it shows (N,), and why. within: how near to a
    simulation PV has to be there to be where it would be anyway, beside what it is rounded to. width: a historian's,
    with its interval. alternatives: names that PV shows as well. most: what its probability is at most, where noise may
    make it. told_share: how many of the samples were stored, where the others were filled in between them.
    """

    part: Part
    shows: BoolArray
    reason: Reason
    hides_pv: bool
    within: float = 0.0
    width: Width | None = None
    alternatives: tuple[str, ...] = ()
    most: float = 1.0
    told_share: float = 1.0


@dataclass(frozen=True)
class Run:
    """A stretch [first, last] of equal samples."""

    first: int
    last: int

    @property
    def length(self) -> int:
        return self.last - self.first + 1


def _noise_deviation(record: Experiment) -> float:
    """Standard deviation of PV's sample-to-sample noise where it is known, from second differences; repeated values
    aside.
    """
    second = np.diff(record.pv, 2)
    moving = second[(second != 0.0) & between_known(record)]
    return float(np.median(np.abs(moving)) / 0.6745 / np.sqrt(6.0)) if len(moving) > 20 else 0.0


def _equal_runs(record: Experiment, tolerance: float) -> tuple[Run, ...]:
    """Runs of at least two samples that repeat the one before within the tolerance; what a gap was bridged with
    repeats nothing.
    """
    known = record.usable[1:] & record.usable[:-1]
    same = known & (np.abs(np.diff(record.pv)) <= tolerance)
    return tuple(Run(int(a), int(b)) for a, b in zip(*runs_of(same), strict=True))


def find_patterns(record: Experiment) -> tuple[Pattern, ...]:
    """What PV shows by itself, the surest first: a limit, stuck stretches, quantisation or compression; where it is
    held between equal intervals, that alone, for the rest shows in what was taken.
    """
    hold = hold_of(record.pv, record.usable)
    if hold is not None:
        return (held(record, hold.interval * record.sampling_interval_s),)
    noise = _noise_deviation(record)
    runs = _equal_runs(record, 0.02 * noise)
    step = level_spacing(record.pv[record.usable])
    coarse = step > max(_STEP_OVER_NOISE * _innovation_floor(record.pv), _STEP_OVER_SPAN * record.pv_span)
    rests = coarse or _holds(record)
    limits = _limits_of(record, runs, rests)
    explained = np.any([p.shows for p in limits], axis=0) if limits else np.zeros(record.samples, dtype=np.bool_)
    stuck = _stuck_stretches(record, runs, explained, rests)
    if coarse:
        return (*limits, *stuck, _quantised(record, step))
    squeezed = None if limits or stuck else compressed(record)
    if squeezed is not None:
        return (squeezed,)
    found = (*limits, *stuck)
    return found if rests else (*found, *_frozen_stretches(record, [pattern.shows for pattern in found]))


def held(record: Experiment, interval_s: float) -> Pattern:
    """A PV that is measured every `interval_s` (s) and held until the next time: shown at all samples (N,), explained
    by a sample and hold of that interval.
    """
    text = f"PV changes only every {interval_s:.4g} s and repeats itself in between: it is compared when it changes"
    everywhere = np.ones(record.samples, dtype=np.bool_)
    return Pattern(Part(SAMPLE_HOLD, np.array([interval_s])), everywhere, Reason("pv_held", text), False)


def _holds(record: Experiment) -> bool:
    """Whether PV repeats itself most of the time, also away from its extremes: a historian that stores changes."""
    away = _away_from_extremes(record) & record.usable
    still = np.abs(np.diff(record.pv)) <= 1e-9 * record.pv_span
    return bool(np.mean(still[away[1:]]) > _HOLDS) if away.sum() > _LEAST_RUN else False


def _away_from_extremes(record: Experiment) -> BoolArray:
    margin = _NEAR_EXTREME * record.pv_span
    return (record.pv > np.min(record.pv) + margin) & (record.pv < np.max(record.pv) - margin)


def _innovation_floor(pv: FloatArray) -> float:
    """Standard deviation of the white noise that would make PV's changes from sample to sample: theirs over sqrt 2."""
    return float(np.std(np.diff(pv)) / np.sqrt(2.0))


def _quantised(record: Experiment, step: float) -> Pattern:
    known = record.pv[record.usable]
    text = f"PV takes {len(np.unique(known))} levels, {step:.4g} apart, wider than its noise"
    everywhere = np.ones(record.samples, dtype=np.bool_)
    level = float(np.min(known)) - record.pv_mid
    return Pattern(Part(QUANTIZATION, np.array([step, level])), everywhere, Reason("pv_levels", text), False)


def _limits_of(record: Experiment, runs: tuple[Run, ...], coarse: bool) -> tuple[Pattern, ...]:
    """The ends of the sensor's range; none where PV hardly ever leaves them, for then nothing shows that it would."""
    found = [p for p in (_at_limit(record, runs, 1.0, coarse), _at_limit(record, runs, -1.0, coarse)) if p is not None]
    limited = np.any([p.shows for p in found], axis=0) if found else np.zeros(record.samples, dtype=np.bool_)
    return tuple(found) if np.sum(record.usable & ~limited) >= _LEAST_FREE else ()


def _at_limit(record: Experiment, runs: tuple[Run, ...], sign: float, coarse: bool) -> Pattern | None:
    """PV that repeats its extreme value, again and again or for long: the end of a range."""
    if coarse:
        return None
    extreme = sign * np.max(sign * record.pv)
    near = record.usable & (np.abs(record.pv - extreme) <= 1e-6 * record.pv_span)
    there = [run for run in runs if near[run.first]]
    repeated = sum(run.length for run in there)
    if repeated < _LEAST_AT_LIMIT or (len(there) == 1 and jumps_free(record.pv, there[0])):
        return None
    block: Block = LIMIT_HIGH if sign > 0 else LIMIT_LOW
    text = f"PV is at its {'highest' if sign > 0 else 'lowest'} value {extreme:.5g} for {repeated:,} samples"
    shows = _closed_gaps(near, 15)
    return Pattern(Part(block, np.array([extreme - record.pv_mid])), shows, Reason("pv_at_limit", text), True)


def _closed_gaps(mask: BoolArray, longest: int) -> BoolArray:
    """The mask with gaps of at most `longest` samples closed; single samples that stand alone are dropped."""
    at = np.flatnonzero(mask)
    out = np.zeros_like(mask)
    if len(at) == 0:
        return out
    for group in np.split(at, np.flatnonzero(np.diff(at) > longest + 1) + 1):
        if len(group) > 2:
            out[group[0] : group[-1] + 1] = True
    return out


def _stuck_stretches(
    record: Experiment, runs: tuple[Run, ...], explained: BoolArray, coarse: bool
) -> tuple[Pattern, ...]:
    """Runs far longer than all others, away from the limits: one sensor that stood still."""
    free = [run for run in runs if not explained[run.first : run.last + 1].any()]
    lengths = np.sort([run.length for run in free])
    others = lengths[: len(lengths) - min(_MOST_STUCK, len(lengths) // 2)]
    usual = float(np.quantile(others, 0.9)) if len(lengths) > 4 else 2.0
    # Among wide levels PV repeats itself for long whenever the loop is calm: only one stretch far beyond the others
    # counts.
    second = float(lengths[-2]) if coarse and len(lengths) > 1 else 0.0
    needed = max(_LEAST_RUN, 5.0 * usual, 3.0 * second)
    found = [run for run in free if run.length >= needed]
    away = _away_from_extremes(record)
    made = _of_a_sensor(record, found, lambda run: bool(away[run.first]))
    return tuple(_dropped(record, run) if _jumps_there(record.pv, run) else _stuck(record, run) for run in made)


def _of_a_sensor(record: Experiment, runs: list[Run], away: Callable[[Run], bool]) -> list[Run]:
    """Those of the runs that a sensor makes, the longest first; none where they are too many. away: from the extremes
    of PV.
    """
    # A PV that rests because nothing moves is not stuck.
    runs = [run for run in runs if np.ptp(record.op[run.first : run.last + 1]) > _STILL * record.op_span]
    # Near its extremes PV may rest because a limit presses it: that is for the competition to say. A limit lets go of
    # PV where it is; a sensor that comes free jumps to where PV went.
    runs = [run for run in runs if away(run) or jumps_free(record.pv, run)]
    return sorted(runs, key=lambda run: -run.length) if len(runs) <= _MOST_STUCK else []


def jumps_free(pv: FloatArray, run: Run) -> bool:
    """Whether PV (N,) leaves a run by a step such as it hardly ever takes."""
    return run.last + 1 < len(pv) and _jumps_from(pv, run.last)


def _jumps_there(pv: FloatArray, run: Run) -> bool:
    """Whether PV (N,) comes to a run by such a step and leaves it by one back: a sensor that is stuck repeats what it
    measured last, and PV goes on from there.
    """
    if not (run.first > 0 and _jumps_from(pv, run.first - 1) and jumps_free(pv, run)):
        return False
    return bool((pv[run.first] - pv[run.first - 1]) * (pv[run.last + 1] - pv[run.last]) < 0.0)


def _jumps_from(pv: FloatArray, at: int) -> bool:
    steps = np.abs(np.diff(pv))
    return bool(steps[at] > _JUMP * np.quantile(steps, 0.99))


def _stuck(record: Experiment, run: Run) -> Pattern:
    ts = record.sampling_interval_s
    values = np.minimum(record.first_s + np.array([(run.first + 1) * ts, (run.last + 1) * ts]), record.end_s)
    shows = np.zeros(record.samples, dtype=np.bool_)
    shows[run.first + 1 : run.last + 1] = True
    text = f"PV repeats {record.pv[run.first]:.5g} for {run.length:,} samples while OP keeps moving"
    return Pattern(Part(STUCK, values), shows, Reason("pv_repeats", text), True)


def _dropped(record: Experiment, run: Run) -> Pattern:
    """A signal that was lost, in place of which something else was recorded; where a process is faster than the samples
    are apart, what fell away for a while in it does the same, and a sensor that stuck since before does where the first
    of its samples were lost.
    """
    value, kept = float(record.pv[run.first]), _stuck(record, Run(run.first - 1, run.last))
    text = (
        f"PV jumps to {value:.5g}, repeats it for {run.length:,} samples while OP keeps moving, and jumps back: "
        "that is neither the last measured value nor on PV's path"
    )
    part = Part(DROPOUT, np.array([*kept.part.values, value - record.pv_mid]))
    return replace(kept, part=part, reason=Reason("pv_dropped", text), alternatives=_LOST_OR, most=LOST)


def _frozen_stretches(record: Experiment, explained: list[BoolArray]) -> tuple[Pattern, ...]:
    """Stretches in which PV stands beside a little noise of what reads it, while OP moves on: a transmitter that froze
    and repeats no value to the last digit. explained: (N,) each, where PV shows something else.
    """
    runs = [Run(first, last) for first, last in quiet_stretches(record)]
    runs = [run for run in runs if not any(shows[run.first : run.last + 1].any() for shows in explained)]
    found = _of_a_sensor(record, runs, lambda run: within_range(record, run.first, run.last))
    return tuple(_frozen(record, run) for run in found)


def _frozen(record: Experiment, run: Run) -> Pattern:
    pv = record.pv[run.first : run.last + 1]
    low, high = f"{np.min(pv):.5g}", f"{np.max(pv):.5g}"
    where = f"at {low}" if low == high else f"between {low} and {high}"
    text = f"PV stays {where} for {run.length:,} samples, with less noise than elsewhere, while OP keeps moving"
    return replace(_stuck(record, run), reason=Reason("pv_frozen", text), within=_noise_deviation(record), most=FROZEN)


def compressed(record: Experiment) -> Pattern | None:
    """PV that runs along straight lines, or holds and jumps: a historian kept only some of its samples."""
    first, second = np.diff(record.pv), np.diff(record.pv, 2)
    typical = float(np.std(first))
    straight = np.abs(second) < 0.02 * typical
    away = _away_from_extremes(record)[1:-1] & between_known(record)
    share = float(np.mean(straight[away])) if away.sum() > _LEAST_RUN else 0.0
    if share < 0.4 or typical == 0.0:
        return None
    kept = np.concatenate(([0], np.flatnonzero(~straight) + 1, [record.samples - 1]))
    text = f"{100 * share:.0f} % of PV's samples lie on a straight line between their neighbours"
    everywhere = np.ones(record.samples, dtype=np.bool_)
    part, width = _how_compressed(record, kept)
    if width is not None and not record.stored_evenly:
        width = unbounded(width, record.pv)
    told = _stored_share(record, part, kept)
    return Pattern(part, everywhere, Reason("pv_straight", text), False, width=width, told_share=told)


def _stored_share(record: Experiment, part: Part, kept: IntArray) -> float:
    """How many of a historian's samples it stored: those at which PV leaves a line, or to which it moved."""
    if part.block is HELD:
        kept = np.flatnonzero(np.abs(np.diff(record.pv)) > _STANDS_STILL * record.pv_span)
    return min(max(len(kept), _LEAST_RUN) / record.samples, 1.0)


def _how_compressed(record: Experiment, kept: IntArray) -> tuple[Part, Width | None]:
    """Lines between every m-th sample, values held until they have moved, or a swinging door; with its width."""
    spacing = np.diff(kept)
    usual = float(np.median(spacing))
    if usual > 1.0 and np.mean(np.abs(spacing / usual - np.round(spacing / usual)) < 0.01) > _REGULAR:
        return Part(INTERPOLATED, np.array([usual * record.sampling_interval_s])), None
    moves = np.abs(np.diff(record.pv))[record.usable[1:] & record.usable[:-1]]
    still = moves <= _STANDS_STILL * record.pv_span
    if not still.all() and still.mean() > _HOLDS:
        band = band_of(moves[~still])
        return Part(HELD, np.array([band.value])), band
    width = door_of(record.pv, kept)
    return Part(COMPRESSION, np.array([width.value])), width
