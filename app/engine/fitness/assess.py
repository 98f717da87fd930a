"""Can this recording be audited at all, and on which of its samples?"""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.codes import CheckCode
from app.engine.evidence import Finding
from app.engine.fitness import checks
from app.engine.fitness.align import Aligned, align
from app.engine.fitness.config import FitnessConfig
from app.engine.fitness.holes import newest_without_hole
from app.engine.fitness.repeated import once_a_scan
from app.engine.fitness.resample import is_regular, lasting, most_filled, to_uniform
from app.engine.fitness.samples import Samples
from app.engine.fitness.signals import (
    at_extremes,
    newest_long_run,
    run_lengths,
    still_at_its_end,
    usable_values,
)
from app.engine.fitness.skew import skew_of, without_skew
from app.engine.fitness.standstill import Standstill, as_far_as_ever, standstill
from app.engine.oscillation import Oscillation
from app.engine.recording import BoolArray, FloatArray, Recording, UniformRecord
from app.engine.signals.runs import runs_of
from app.errors import DataError

LATER_CHECKS: tuple[CheckCode, ...] = (
    "not_in_automatic", "gaps", "op_flat", "pv_flat", "op_two_values", "op_at_limits", "irregular_sampling",
    "filled", "pv_quantised", "op_quantised", "pv_interpolated", "op_interpolated", "time_skew",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Whole:
    """A long record that was judged stretch by stretch: the middle one of them speaks for it.

    record: all of it. oscillation: of all of it. agreeing: how many of the `judged` stretches are on the side of the
    one that speaks. newest_agree: whether one of the newest two of them is. standing: how many were left out because
    PV or OP stood still in them.
    """

    record: UniformRecord
    oscillation: Oscillation
    agreeing: int
    judged: int
    newest_agree: bool
    standing: int

    @property
    def contested(self) -> bool:
        """Whether fewer than two of three stretches are on its side, or the newest two are not."""
        return 3 * self.agreeing < 2 * self.judged or not self.newest_agree


@dataclass(frozen=True, eq=False)
class Fitness:
    """Whether and on which stretch a recording can be audited, check by check.

    findings: one a check, in the order in which they were made.
    record: the stretch that is audited, on a uniform time base; None where nothing can be audited.
    missing_share: samples of the recording without PV or OP, 0 to 1.
    automatic_share: samples in automatic, 0 to 1; None where the mode was not recorded.
    filled_share: samples of `record` that were interpolated into holes, 0 to 1; None without a record.
    gaps: holes that split the recording. repeats: how many samples it has of each scan; one of them is judged.
    pv_dead_s: for how long PV has held one value up to the recording's end while OP moved, and never before, in s; else
    None.
    wound_up_s: for how long OP has stood at its limit up to the recording's end, as never before, while PV stayed away,
    in s.
    standstill: since when PV stands up to the recording's end and does not answer OP; None where it does, or where it
    has its reasons.
    speaks_for: the long record for which `record` speaks; None where `record` is all that is judged.
    """

    findings: tuple[Finding, ...]
    record: UniformRecord | None
    missing_share: float
    automatic_share: float | None
    filled_share: float | None
    gaps: int
    repeats: int = 1
    pv_dead_s: float | None = None
    wound_up_s: float | None = None
    standstill: Standstill | None = None
    speaks_for: Whole | None = None

    @property
    def auditable(self) -> bool:
        return self.record is not None and not self.refusals

    @property
    def audited(self) -> UniformRecord:
        """`record`, where there is one; raises DataError("not_auditable") where there is none."""
        if self.record is None:
            raise DataError("not_auditable", "; ".join(finding.text for finding in self.refusals))
        return self.record

    @property
    def looked_at(self) -> UniformRecord:
        """All that a judgement on `audited` stands for; raises as that does."""
        return self.audited if self.speaks_for is None else self.speaks_for.record

    @property
    def whole(self) -> UniformRecord | None:
        """All of the stretch, be it refused, of which `record` is a part; None where there is none."""
        return self.record if self.speaks_for is None else self.speaks_for.record

    @property
    def long_enough(self) -> bool:
        """Whether there are samples enough to judge by, whatever they are like."""
        return not any(finding.code in checks.OF_LENGTH for finding in self.refusals)

    @property
    def refusals(self) -> tuple[Finding, ...]:
        """The findings for which the recording is not audited."""
        return checks.refusals(self.findings)


def assess(recording: Recording, config: FitnessConfig | None = None) -> Fitness:
    """The fitness checks in their order; each narrows the recording to what can be audited, and says so.

    Of a scan that was stored several times one sample is kept. Missing values are taken out, and those that lie alone
    and far from all others, then the newest long stretch in automatic is kept, of it the newest long one without a
    hole, then the newest long one beside dead PV or OP, and that stretch is put on a uniform time base. A recording is
    refused where a step leaves fewer than `config.min_samples`, where OP is switched between two values or stands at a
    limit, or where too much had to be filled. Where OP and the PV that it answers were stamped apart, both are put
    beside each other.
    No answer depends on the unit, scale, offset or sign of PV or OP, nor on where time starts; but whether PV stands
    at its set point, and on which side of one that moves it is, is asked in one unit of both.
    """
    config = config or FitnessConfig()
    scanned = once_a_scan(recording, config)
    aligned = align(scanned.recording, config)
    samples, both = _samples(scanned.recording, aligned), aligned.both
    automatic_share = None if samples.automatic is None or not len(samples) else float(np.mean(samples.automatic))
    missing_share = 1.0 - float(np.mean(both)) if len(both) else 0.0
    fitness = Fitness((), None, missing_share, automatic_share, None, 0, repeats=scanned.repeats)
    length = checks.check_length(scanned.recording.samples, config, scanned.repeats)
    if length.outcome == "fail":
        return _stopped(fitness, (length,), ("missing_values", "wild_samples", *LATER_CHECKS))
    found = (
        length,
        checks.check_missing(both, aligned.interpolated, config),
        checks.check_wild(aligned.wild_pv, aligned.wild_op),
    )
    if len(samples) < config.min_samples:
        return _stopped(fitness, found, LATER_CHECKS)
    stands = standstill(samples, recording, config)
    return _assess_stretches(recording, samples, replace(fitness, findings=found, standstill=stands), config)


def refused_as_standing(fitness: Fitness) -> Fitness:
    """The same fitness, refused because PV stands up to the end, where `pv_flat` does not say so already: what was
    before can be audited, and tells nothing of how the loop is.
    """
    if fitness.standstill is None or any(finding.code == "pv_flat" for finding in fitness.refusals):
        return fitness
    stands = checks.pv_stands(fitness.standstill)
    kept = tuple(stands if finding.code == "pv_flat" else finding for finding in fitness.findings)
    return replace(fitness, findings=kept)


def with_cycles(fitness: Fitness, oscillation: Oscillation | None, config: FitnessConfig | None = None) -> Fitness:
    """The same fitness with the checks that need the oscillation's period: samples and stored points a cycle, cycles in
    the stretch.

    oscillation: of `fitness.record`, or None where the recording is not auditable anyway.
    """
    config = config or FitnessConfig()
    if fitness.record is None or oscillation is None:
        return _stopped(fitness, fitness.findings, ("samples_per_cycle", "few_cycles", "stored_points"))
    added = (
        checks.check_samples_per_cycle(oscillation, config),
        checks.check_cycles(oscillation, fitness.record, config),
        checks.check_stored_points(oscillation, fitness.record, config),
    )
    return replace(fitness, findings=fitness.findings + added)


def _samples(recording: Recording, aligned: Aligned) -> Samples:
    sp = None
    if recording.sp is not None:
        sp = np.where(usable_values(recording.sp), recording.sp, np.nan)
    automatic = None if recording.automatic is None else np.asarray(recording.automatic, dtype=bool)
    return Samples(recording.time_s, aligned.pv, aligned.op, sp, automatic).part(aligned.both)


def _assess_stretches(recording: Recording, samples: Samples, fitness: Fitness, config: FitnessConfig) -> Fitness:
    acting = _newest_automatic(samples, config)
    in_automatic, after = _in_automatic(samples.part(acting)), len(samples) - acting.stop
    found = (*fitness.findings, checks.check_automatic(samples.automatic, len(in_automatic), after, config))
    if len(in_automatic) < config.min_samples:
        return _stopped(fitness, found, LATER_CHECKS[1:])
    unbroken = newest_without_hole(in_automatic.time_s, config)
    whole, later = in_automatic.part(unbroken.samples), len(in_automatic) - unbroken.samples.stop
    found = (*found, checks.check_gaps(unbroken, len(whole), len(in_automatic), later, config))
    fitness = replace(fitness, gaps=unbroken.holes)
    if len(whole) and whole.time_s[-1] == samples.time_s[-1]:
        fitness = replace(fitness, pv_dead_s=_dead_s(whole, config), wound_up_s=_wound_up_s(whole, config))
    if len(whole) < config.min_samples:
        return _stopped(fitness, found, LATER_CHECKS[2:])
    alive = whole.part(newest_long_run(_alive(whole, config), config.newest_share, config.min_samples))
    found += (
        checks.check_flat("op", whole.op, "not controlling, or a frozen signal", len(alive), config),
        checks.check_flat("pv", whole.pv, "a stuck valve or a dead transmitter", len(alive), config),
    )
    if len(alive) < config.min_samples:
        return _stopped(fitness, found, LATER_CHECKS[4:])
    return _assess_record(recording, alive, replace(fitness, findings=found), config)


def _assess_record(recording: Recording, samples: Samples, fitness: Fitness, config: FitnessConfig) -> Fitness:
    origin_s = float(recording.time_s[0]) if np.isfinite(recording.time_s[0]) else float(samples.time_s[0])
    record = to_uniform(samples.time_s, samples.pv, samples.op, samples.sp, origin_s, config)
    two_values, skew = checks.check_two_values(samples.op, config), skew_of(record)
    found = (
        *fitness.findings,
        two_values,
        checks.check_op_limits(samples.op, recording.op_range, two_values, config),
        checks.check_sampling(is_regular(samples.time_s, config), record, fitness.repeats),
        checks.check_filled(record, config),
        checks.check_levels("pv", samples.pv, config),
        checks.check_levels("op", samples.op, config),
        checks.check_on_line("pv", samples.pv, config),
        checks.check_on_line("op", samples.op, config),
        checks.check_skew(skew, record),
    )
    filled_share = float(np.mean(record.filled))
    if skew is not None:
        record = without_skew(record, skew.samples)
    return replace(fitness, findings=found, record=record, filled_share=filled_share)


def _newest_automatic(samples: Samples, config: FitnessConfig) -> slice:
    if samples.automatic is None:
        return slice(0, len(samples))
    return newest_long_run(_bridged(samples, config), config.newest_share, config.min_samples, samples.automatic)


def _bridged(samples: Samples, config: FitnessConfig) -> BoolArray:
    """(N,) True in automatic, and in spells out of it that are no longer than a hole that is filled, but not where they
    are too many to fill: a tag of the mode that blinks ends no stretch.
    """
    automatic = np.asarray(samples.automatic)
    at = np.flatnonzero(automatic)
    time_s = samples.time_s[at]
    longest_s = lasting(most_filled(len(samples), config), samples.time_s)
    brief = (np.diff(at) > 1) & (np.diff(time_s) <= longest_s)
    bridged = automatic.copy()
    for k in np.flatnonzero(brief):
        bridged[at[k] : at[k + 1]] = True
    for first, behind in zip(*runs_of(bridged), strict=True):
        if np.mean(automatic[first:behind]) < 1.0 - config.max_filled_share:
            bridged[first:behind] = automatic[first:behind]
    return bridged


def _in_automatic(samples: Samples) -> Samples:
    """What was recorded out of automatic in a bridged stretch is no more the loop's than what is missing."""
    return samples if samples.automatic is None else samples.part(samples.automatic)


def _dead_s(samples: Samples, config: FitnessConfig) -> float | None:
    still, before = still_at_its_end(samples.pv, samples.op)
    if still < max(config.least_still, config.longer_still * before):
        return None
    if len(np.unique(samples.op[-still:])) < config.fewest_moves:  # a unit that is shut down by hand
        return None
    moves = as_far_as_ever(samples.op[:-still], samples.op[-still:], config)
    return _since_s(samples, len(samples) - still) if moves else None


def _wound_up_s(samples: Samples, config: FitnessConfig) -> float | None:
    """Since when OP stands mostly at its limits, which it reached by itself, and PV does not come back for it."""
    op = samples.op
    low, high = at_extremes(op)
    side = np.where(run_lengths(op) >= config.least_at_limit, high * 1.0 - low, 0.0)
    first = int(np.argmax(side != 0.0))
    if len(op) - first < config.least_still or first < config.least_still or not _mostly(side[first:] != 0.0):
        return None
    if abs(op[first] - op[first - 1]) > config.most_jump * float(np.ptp(op)):  # as by hand
        return None
    away = _away(samples, first)
    known = (side != 0.0) & np.isfinite(away)
    one_sided = known.any() and abs(float(np.mean((away * side)[known]))) >= config.one_sided
    return _since_s(samples, first) if one_sided else None


def _mostly(at_limit: BoolArray) -> bool:
    """For half of the time, of the newest quarter too: what came back hours ago is not wound up any more."""
    return bool(np.mean(at_limit) >= 0.5 and np.mean(at_limit[-(len(at_limit) // 4) :]) >= 0.5)


def _away(samples: Samples, first: int) -> FloatArray:
    """(N,) on which side of where it mostly was before `first` PV is, of SP where that is known: 1, 0 or -1. What PV
    and SP differ by all the time, as in two units, does not count.
    """
    pv, sp = samples.pv, samples.sp
    error = pv if sp is None or np.isnan(sp[:first]).all() else pv - sp
    return np.sign(error - np.nanmedian(error[:first]))


def _since_s(samples: Samples, first: int) -> float:
    return float(samples.time_s[-1] - samples.time_s[first])


def _alive(samples: Samples, config: FitnessConfig) -> BoolArray:
    limit = config.flat_share * len(samples)
    return (run_lengths(samples.pv) < limit) & (run_lengths(samples.op) < limit)


def _stopped(fitness: Fitness, found: tuple[Finding, ...], left: tuple[CheckCode, ...]) -> Fitness:
    failed = ", ".join(finding.code for finding in checks.refusals(found))
    because = f"the recording had already failed: {failed.replace('_', ' ')}"
    skipped = tuple(checks.not_evaluated(code, because) for code in left)
    return replace(fitness, findings=found + skipped)
