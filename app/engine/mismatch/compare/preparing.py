"""A comparison made ready: what of PV is compared, the linear model behind the simulation, and its refit."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.compare.comparison import Comparison, given_of, record_of
from app.engine.mismatch.compare.patterns import Pattern, find_patterns, held
from app.engine.mismatch.compare.sampling import Taken
from app.engine.mismatch.fit.bending import Bent, bent_with
from app.engine.mismatch.fit.fitting import Fit, fit_linear
from app.engine.mismatch.fit.given import identify
from app.engine.mismatch.fit.levels import decimals_of
from app.engine.mismatch.fit.refitting import off_in_words
from app.engine.mismatch.fit.shifting import InStep, in_step
from app.engine.mismatch.fit.task import OWN_DEVIATION, Given
from app.engine.mismatch.judge.conclude import ROUNDING, unrelated
from app.engine.mismatch.loop.beginning import answers_the_record
from app.engine.mismatch.loop.chain import simulate
from app.engine.mismatch.loop.experiment import FIRST_SAMPLES, Experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics.sensor_pattern import QUANTIZATION
from app.engine.recording import FloatArray
from app.errors import DataError

OTHER_UNIT, _LEAST_ALIKE = 8.0, 0.5  # so many times PV's size, and so much of PV's shape
_STRETCHES, _ALIKE = 12, 0.8


@dataclass(frozen=True, eq=False)
class Prepared:
    """A comparison ready to be explained: the record, the patterns of PV, the given model and its refit. off: how far
    its parameters are from the record, where that is further than it was trusted. unrelated: why the given trace is
    none of this OP. given: the linear model of the simulation as it came, started where PV started. acted: the record
    in which the controller acted, before anything was shortened. laid: the given trace as it was compared, multiplied
    by `share`; None where none was given. bent: how what the trace holds beside its linear model was changed to the
    parameters found; None where it was not.
    """

    record: Experiment
    patterns: tuple[Pattern, ...]
    given_trace: FloatArray | None
    base: Fit
    off: tuple[Reason, ...] = ()
    unrelated: tuple[Reason, ...] = ()
    given: Plant | None = None
    acted: Experiment | None = None
    laid: InStep | None = None
    share: float = 1.0
    bent: Bent | None = None


def prepare(comparison: Comparison, taken: Taken | None = None) -> Prepared:
    """taken: where PV is held between equal intervals, how it was taken; the comparison is one at these instants.

    Raises DataError("nothing_known") where the patterns of PV hide all of it.
    """
    record = record_of(comparison)
    if taken is not None:
        record = taken.timed(record)
    patterns = find_patterns(record)
    prepared = _beside_patterns(comparison, taken, record, patterns)
    stand = tuple(pattern for pattern in patterns if not _foretold(pattern, record, prepared.base))
    if len(stand) < len(patterns):
        prepared = _beside_patterns(comparison, taken, record, stand)
    # Where a pattern hides how PV began, the refit does not know it either.
    for pattern in (p for p in stand if p.hides_pv and p.shows[:FIRST_SAMPLES].any()):
        fewer = tuple(other for other in stand if other is not pattern)
        shown = _beside_patterns(comparison, taken, record, fewer)
        if _foretold(pattern, record, shown.base):
            stand, prepared = fewer, shown
    return prepared


def _foretold(pattern: Pattern, record: Experiment, base: Fit) -> bool:
    """Whether PV, where a pattern shows, is where the linear refit is, but for what PV is rounded to: it rests because
    the process does, and no sensor or historian is seen at work. Where PV is quantised that is what is seen.
    """
    seen = pattern.shows & record.usable
    if pattern.part.block is QUANTIZATION or not seen.any():
        return False
    left = float(np.sqrt(np.mean((record.pv_deviation - base.simulated)[seen] ** 2)))
    return left <= max(decimals_of(record.pv[record.usable]), ROUNDING * record.pv_span, pattern.within)


def _beside_patterns(
    comparison: Comparison, taken: Taken | None, record: Experiment, patterns: tuple[Pattern, ...]
) -> Prepared:
    """The comparison ready where these patterns of PV are believed; as `prepare`."""
    if taken is not None:
        patterns = (held(record, taken.interval_s), *patterns)
    record = without_hidden(record, patterns)
    if not record.usable.any():
        raise DataError("nothing_known", "PV stands still wherever it is known: there is nothing to compare with")
    trace = comparison.trace
    if taken is not None and taken.comparison is comparison:
        record = taken.simulated_between(record)
        trace = comparison.trace if record.finer is None else taken.sampled.trace
    if trace is not None:
        laid = in_step(record.as_sampled, trace)
        behind = laid.behind
        record = record.resting(behind.rest)
        record = record.comparing(answers_the_record(record, behind.given.plant))
        first, share = _refit_in_its_unit(record, behind.given, behind.rest)
        base, bent = bent_with(first, share * behind.rest)
        record = base.record
        off = (*laid.said, *_off_by(behind.given, share))
        plant = _as_pv_begins(record, behind.given)
        other = unrelated(behind)
        return Prepared(record, patterns, comparison.trace, base, off, other, plant, laid=laid, share=share, bent=bent)
    if comparison.simulation is not None:
        given = given_of(comparison.simulation, record)
        record = record.comparing(answers_the_record(record, given.plant))
        base, share = _refit_in_its_unit(record, given)
        plant = _as_pv_begins(record, given)
        trace = simulate(record, plant) + record.pv_mid
        return Prepared(record, patterns, trace, base, _off_by(given, share), given=plant)
    return Prepared(record, patterns, None, identify(record))


def without_hidden(record: Experiment, patterns: tuple[Pattern, ...]) -> Experiment:
    """The record, compared where none of its patterns hides what PV was, as far as PV was stored at all."""
    usable = record.usable.copy()
    for pattern in patterns:
        if pattern.hides_pv:
            usable &= ~pattern.shows
    told = min((pattern.told_share for pattern in patterns), default=1.0)
    return replace(record.comparing(usable), told_share=told)


def _scale_of(record: Experiment, given: Given) -> float:
    """By how much the given gain is to be multiplied, roughly, where it is in another unit; 1 where it is of PV's size
    over the record or a stretch of it: where PV follows no further, for a limit, OP and the simulation go far.
    """
    if given.integrating:
        return 1.0
    simulated = run_process(record.op_deviation, given.plant, record.sampling_interval_s)[record.usable]
    pv = record.pv_deviation[record.usable]
    whole = _share_of(simulated, pv)
    if not whole.tells(_LEAST_ALIKE) or whole.of_its_size:
        return 1.0
    parts = [_share_of(*both) for both in zip(*(np.array_split(s, _STRETCHES) for s in (simulated, pv)), strict=True)]
    return 1.0 if any(part.tells(_ALIKE) and part.of_its_size for part in parts) else whole.value


@dataclass(frozen=True)
class _Share:
    """How much of a simulation's moves PV makes (value), and how alike the two are."""

    value: float
    correlation: float

    def tells(self, least: float) -> bool:
        return self.value > 0.0 and self.correlation > least

    @property
    def of_its_size(self) -> bool:
        return 1.0 / OTHER_UNIT < self.value < OTHER_UNIT


def _share_of(simulated: FloatArray, pv: FloatArray) -> _Share:
    moves, shown = simulated - np.mean(simulated), pv - np.mean(pv)
    power, both = float(moves @ moves), float(moves @ shown)
    return _Share(both / max(power, 1e-300), both / max(np.sqrt(power * float(shown @ shown)), 1e-300))


def _refit_in_its_unit(record: Experiment, given: Given, rest: FloatArray | None = None) -> tuple[Fit, float]:
    """The refit of a given model, and by how much its gain, and what (N,) its trace holds beside it (rest), is
    multiplied: by a fit under coloured noise where it is in another unit, which `_scale_of` only tells.
    """

    def refit(share: float) -> Fit:
        beside = record if rest is None else record.resting(share * rest)
        return fit_linear(beside, _scaled(given, share))

    share = _scale_of(record, given)
    base = refit(share)
    if share == 1.0:
        return base, share
    share = base.plant.K / given.plant.K
    return refit(share), share


def _scaled(given: Given, share: float) -> Given:
    """The given model with its gain in the unit of PV: our own guess then, from the same record, and short of the true
    one where a load moves PV, because OP works against it.
    """
    if share == 1.0:
        return given
    return replace(given, plant=given.plant.changed(K=share * given.plant.K), gain_deviation=OWN_DEVIATION)


def _off_by(given: Given, share: float) -> tuple[Reason, ...]:
    return () if share == 1.0 else (off_in_words(given, _scaled(given, share), "; is it in another unit?"),)


def _as_pv_begins(record: Experiment, given: Given) -> Plant:
    """The given model, started where PV started and, where it does not integrate, at the level of PV: a model says how
    PV moves, not where it stands.
    """
    plant = given.plant.changed(b=0.0, x0=record.pv_first)
    if plant.leak == 0.0:
        return plant
    beside = (record.pv_deviation - simulate(record, plant))[record.usable]
    return plant.changed(b=float(np.mean(beside)) if len(beside) else 0.0)
