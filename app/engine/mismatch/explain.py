"""From a recording and a simulation to an explanation: the one function that walks the whole way."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine import ENGINE_VERSION
from app.engine.evidence import Reason
from app.engine.mismatch.block import Context, Part
from app.engine.mismatch.closed_loop import ClosedLoop, close_again
from app.engine.mismatch.experiment import Experiment, experiment
from app.engine.mismatch.fitting import Fit, Given, fit_linear, make_task, settle, start_at
from app.engine.mismatch.given import behind_trace, identify
from app.engine.mismatch.holdout import judge, kept_out, refit_without
from app.engine.mismatch.locate import quick_location
from app.engine.mismatch.patterns import Pattern, find_patterns
from app.engine.mismatch.physics import library
from app.engine.mismatch.plant import Plant
from app.engine.mismatch.report import effects_of, export, location_of, pattern_effect, refit_estimates
from app.engine.mismatch.result import Effect, Explanation, Improvement, Location, Traces
from app.engine.mismatch.selection import Selection, select
from app.engine.mismatch.validation import validate
from app.engine.mismatch.windows import windows_of
from app.engine.recording import BoolArray, FloatArray
from app.errors import DataError

LEAST_SAMPLES = 100
LEAST_TIME_CONSTANT = 0.05


@dataclass(frozen=True)
class LinearSimulation:
    """An engineer's model: gain (PV per OP, per second where integrating), time constants and dead time in s."""

    gain: float
    time_constants_s: tuple[float, ...] = ()
    dead_time_s: float = 0.0
    integrating: bool = False


@dataclass(frozen=True, eq=False)
class Comparison:
    """What is compared: equally sampled signals (N,), and the simulation as a trace (N,), as a model, or None for our
    own.

    sampling_interval_s: s. op, pv, sp: engineering units; measured: further signals by name. known: (N,) False where
    PV was filled in.
    """

    name: str
    sampling_interval_s: float
    op: FloatArray
    pv: FloatArray
    sp: FloatArray | None = None
    measured: tuple[tuple[str, FloatArray], ...] = ()
    known: BoolArray | None = None
    trace: FloatArray | None = None
    simulation: LinearSimulation | None = None


@dataclass(frozen=True, eq=False)
class Prepared:
    """A comparison ready to be explained: the record, the patterns of PV, the given model and its refit."""

    record: Experiment
    patterns: tuple[Pattern, ...]
    given_trace: FloatArray | None
    base: Fit


def explain(comparison: Comparison, validation: Comparison | None = None) -> Explanation:
    """Where a recording and a simulation differ, which physics was left out, and how much better it fits with it.

    `validation`: a second recording, simulated only, with the model of the first.
    Raises DataError("too_short", "signal_constant", "signal_length", "simulation_length", "simulation_not_finite",
    "model_invalid").
    Misleads where OP hardly moves: then little can be told, and the answer is `consistent`.
    """
    prepared = prepare(comparison)
    codes = tuple(pattern.part.block.code for pattern in prepared.patterns)
    blocks = library(prepared.record)
    selection = select(prepared.base, blocks, codes)
    selection = replace(selection, fit=settle(selection.fit))
    explanation = assemble(comparison, prepared, selection)
    if validation is None:
        return explanation
    check(validation)
    second = experiment(
        validation.sampling_interval_s, validation.op, validation.pv, validation.sp, validation.measured
    )
    sensors = tuple(pattern.part for pattern in prepared.patterns)
    return replace(explanation, validation=validate(prepared.base, selection.fit, sensors, second, validation.trace))


def locate(comparison: Comparison) -> Location:
    """A first answer without a competition: where the two differ, from scans alone."""
    prepared = prepare(comparison)
    return quick_location(prepared.base, prepared.patterns, library(prepared.record))


def prepare(comparison: Comparison) -> Prepared:
    check(comparison)
    record = experiment(
        comparison.sampling_interval_s, comparison.op, comparison.pv, comparison.sp, comparison.measured
    )
    patterns = find_patterns(record)
    usable = np.ones(record.samples, dtype=np.bool_) if comparison.known is None else comparison.known.copy()
    for pattern in patterns:
        if pattern.hides_pv:
            usable &= ~pattern.shows
    record = record.comparing(usable)
    if comparison.trace is not None:
        behind = behind_trace(record, comparison.trace)
        record = replace(record, rest=behind.rest)
        return Prepared(record, patterns, comparison.trace, fit_linear(record, behind.given))
    if comparison.simulation is not None:
        given = given_of(comparison.simulation, record)
        base = fit_linear(record, given)
        return Prepared(record, patterns, as_it_came(record, given), base)
    return Prepared(record, patterns, None, identify(record))


def check(comparison: Comparison) -> None:
    n = len(comparison.pv)
    if n < LEAST_SAMPLES:
        raise DataError(
            "too_short", f"{n} samples are too few to explain a difference, at least {LEAST_SAMPLES} are needed"
        )
    for name, signal in (("OP", comparison.op), ("SP", comparison.sp), *comparison.measured):
        if signal is not None and len(signal) != n:
            raise DataError("signal_length", f"{name} has {len(signal)} samples, PV has {n}; they must be the same")
    if comparison.trace is not None and len(comparison.trace) != n:
        raise DataError("simulation_length", f"the simulation has {len(comparison.trace)} samples, the recording {n}")
    if comparison.trace is not None and not np.all(np.isfinite(comparison.trace)):
        raise DataError(
            "simulation_not_finite", "the simulation has samples without a value; it must cover the recording"
        )
    for name, signal in (("OP", comparison.op), ("PV", comparison.pv)):
        if not np.all(np.isfinite(signal)) or np.ptp(signal) <= 0.0:
            raise DataError(
                "signal_constant", f"{name} is constant or not finite: there is nothing to compare a simulation with"
            )


def given_of(simulation: LinearSimulation, record: Experiment) -> Given:
    taus = sorted((t for t in simulation.time_constants_s if t > 0.0), reverse=True)
    if not np.isfinite(simulation.gain) or simulation.gain == 0.0 or len(taus) > 2 or simulation.dead_time_s < 0.0:
        raise DataError(
            "model_invalid",
            "a model needs a gain other than 0, up to two time constants and a dead time that is not negative",
        )
    if simulation.integrating:
        plant = Plant(simulation.gain, 1.0, simulation.dead_time_s, tau2=taus[0] if taus else 0.0, leak=0.0)
        return Given(plant, integrating=True, second_order=bool(taus))
    first = taus[0] if taus else LEAST_TIME_CONSTANT * record.sampling_interval_s
    plant = Plant(simulation.gain, first, simulation.dead_time_s, tau2=taus[1] if len(taus) > 1 else 0.0)
    return Given(plant, second_order=len(taus) > 1)


def as_it_came(record: Experiment, given: Given) -> FloatArray:
    """The given model's trace (N,), started where PV started, in the unit of PV."""
    task = make_task(record, given, ())
    start = float(np.mean(record.pv_deviation[:3]))
    settled = start - given.plant.K * float(np.mean(record.op_deviation[:3])) if given.plant.leak > 0.0 else 0.0
    x = start_at(task, given.plant.changed(b=settled, x0=start), np.zeros(0))
    return task.simulated(x) + record.pv_mid


def assemble(comparison: Comparison, prepared: Prepared, selection: Selection) -> Explanation:
    """Held-out figures, effects, windows, model and traces of a selection."""
    usable = prepared.record.usable
    final = selection.fit
    held = kept_out(final, usable)
    base_seen, final_seen = refit_without(prepared.base, held), refit_without(final, held)
    traces = Traces(
        np.arange(prepared.record.samples) * comparison.sampling_interval_s,
        comparison.pv,
        prepared.given_trace,
        base_seen.simulated + prepared.record.pv_mid,
        with_patterns(final_seen, prepared.patterns),
        held,
    )
    effects = (
        *(pattern_effect(p, prepared.record) for p in prepared.patterns),
        *(told for e in selection.effects for told in effects_of(e, final)),
    )
    improvement = improvement_of(traces, comparison)
    closed = close_again(prepared.base, final)
    return Explanation(
        name=comparison.name,
        verdict="missing_physics" if effects else "consistent",
        effects=merged(effects),
        located=location_of(effects),
        fit=improvement,
        validation=None,
        model=export(final, tuple(p.part for p in prepared.patterns)),
        refit=refit_estimates(prepared.base),
        evidence=(*evidence_of(prepared, selection), *controller_evidence(closed)),
        traces=traces,
        closed_loop=closed,
        engine_version=ENGINE_VERSION,
    )


def with_patterns(found: Fit, patterns: tuple[Pattern, ...]) -> FloatArray:
    """The free run seen through the sensor's limits and stuck stretches, (N,) in the unit of PV."""
    signal = found.simulated
    for pattern in patterns:
        part: Part = pattern.part
        if part.block.apply is not None:
            signal = part.block.apply(signal, part.values, Context(found.record, found.plant))
    return signal + found.record.pv_mid


def merged(effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """Effects of one code as one, with all its windows; the first of each keeps its figures."""
    first: dict[str, Effect] = {}
    for effect in effects:
        known = first.get(effect.code)
        windows = (
            effect.windows
            if known is None
            else tuple(sorted((*known.windows, *effect.windows), key=lambda w: w.start_s))
        )
        first[effect.code] = replace(known or effect, windows=windows)
    return tuple(first.values())


def improvement_of(traces: Traces, comparison: Comparison) -> Improvement:
    held = traces.held_out
    given = None if traces.given is None else judge(traces.pv, traces.given, held)
    refitted, explained = judge(traces.pv, traces.refitted, held), judge(traces.pv, traces.explained, held)
    return Improvement(given, refitted, explained, windows_of(held, comparison.sampling_interval_s))


def evidence_of(prepared: Prepared, selection: Selection) -> tuple[Reason, ...]:
    """What the refit alone explained, and how near the best effect that was not believed came."""
    base = prepared.base
    changes = ", ".join(f"{e.name} {e.value:.4g} {e.unit}" for e in refit_estimates(base))
    said = [Reason("refit", f"the simulation's own parameters, fitted: {changes}")]
    if not selection.effects and selection.ranking:
        best = selection.ranking[0]
        said.append(
            Reason(
                "no_effect_pays",
                f"the best effect, {best.block.code}, gains {best.gain:.1f} nat, {best.block.penalty:.1f} are asked",
            )
        )
    return tuple(said)


def controller_evidence(closed: ClosedLoop | None) -> tuple[Reason, ...]:
    """A controller whose law explains its output is cleared; one whose law was not found is not accused either."""
    if closed is None:
        return (
            Reason(
                "controller_not_evaluated",
                "without SP, or without a PID law that explains OP, the controller is not judged",
            ),
        )
    share = 100.0 * closed.law.explained
    return (
        Reason(
            "controller_cleared",
            f"SP and PV explain {share:.2f} % of OP's moves by a PID law: the controller does its part",
        ),
    )
