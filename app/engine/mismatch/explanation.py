"""From a recording and a simulation to an explanation: the one function that walks the whole way."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine import ENGINE_VERSION
from app.engine.evidence import Reason
from app.engine.mismatch.compare.comparison import Comparison, mended, record_of, shortened
from app.engine.mismatch.compare.patterns import Pattern, find_patterns
from app.engine.mismatch.compare.preparing import OTHER_UNIT, Prepared, prepare, without_hidden
from app.engine.mismatch.compare.read_back import without_read_backs
from app.engine.mismatch.compare.resting import Lacking, rest_along, rest_unknown
from app.engine.mismatch.compare.sampling import Taken, taken_of
from app.engine.mismatch.compete.selection import Selection
from app.engine.mismatch.fit.closed_loop import close_again
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.free_run import settle
from app.engine.mismatch.fit.windows import windows_along
from app.engine.mismatch.judge.conclude import (
    conclude,
    held_out_worse,
    op_moves_nothing,
    unseen_data_refuse,
)
from app.engine.mismatch.judge.controller import at_the_controller, controller_evidence, yper_evidence
from app.engine.mismatch.judge.doubting import reviewed
from app.engine.mismatch.judge.holdout import (
    FitMeasures,
    FreeRuns,
    judge,
    kept_out,
    mostly_worse,
    ran_worse,
    refit_without,
    stretches,
    unseen_errors,
    unseen_gain,
)
from app.engine.mismatch.judge.residuals import residual_tests
from app.engine.mismatch.judge.result import Effect, Explanation, Improvement, Traces
from app.engine.mismatch.judge.validation import lasting, validate
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.experiment import Experiment, span
from app.engine.mismatch.missing import compete
from app.engine.mismatch.report import effects_of, export, location_of, pattern_effect, refit_estimates
from app.engine.recording import BoolArray, FloatArray
from app.errors import DataError


def explain(comparison: Comparison, validation: Comparison | None = None) -> Explanation:
    """Where a recording and a simulation differ, which physics was left out, and how much better it fits with it.

    `validation`: a second recording, simulated only, with the models of the first; bad samples are left out of either.
    A given model is simulated there too; of a given trace there has to be one along the second recording (its `trace`).
    Raises DataError("too_short", "interval_invalid", "signal_constant", "signal_length", "signal_not_finite",
    "simulation_length", "simulation_not_finite", "simulation_constant", "nothing_known", "signal_too_large",
    "model_invalid").
    Misleads where OP hardly moves: then little can be told, and the answer is `consistent`.
    """
    second = None if validation is None else mended_second(validation)
    comparison = without_read_backs(mended(comparison))
    taken, acted = taken_of(comparison), record_of(comparison)
    comparison = as_compared(comparison, taken)
    prepared = replace(prepare(comparison, taken), acted=acted)
    competed = compete(prepared)
    prepared = replace(prepared, base=competed.base, off=(*prepared.off, *competed.off))
    told = assemble(comparison, prepared, weighed(prepared, competed.selection))
    if second is None:
        return told.explanation
    by_model = comparison.simulation is not None
    return validated(told.explanation, prepared, told.selection, second, by_model=by_model)


@dataclass(frozen=True, eq=False)
class Weighed:
    """A selection that stands on the record that it was fitted to, and why what was named before it does not."""

    selection: Selection
    refused: tuple[Reason, ...] = ()


def weighed(prepared: Prepared, selection: Selection) -> Weighed:
    """The selection, its names less sure for what they leave, its numbers by its free run where noise took that up;
    nothing of it where OP does not move PV.
    """
    asked = selection if prepared.unrelated else reviewed(prepared.base, selection)
    asked = replace(asked, fit=settle(asked.fit))
    doubts = prepared.unrelated or (op_moves_nothing(asked.fit) if asked.effects else ())
    return Weighed(Selection(prepared.base, (), asked.ranking), doubts) if doubts else Weighed(asked)


def as_compared(comparison: Comparison, taken: Taken | None) -> Comparison:
    """The comparison where PV was taken, and no longer than can be fitted."""
    return shortened(comparison if taken is None else taken.comparison)


def mended_second(validation: Comparison) -> Comparison:
    """As `mended`; what it raises says that it is of the second recording."""
    try:
        return mended(validation)
    except DataError as error:
        raise DataError(error.code, f"in the second recording: {error.message}") from error


def validated(
    explanation: Explanation, prepared: Prepared, selection: Selection, second: Comparison, *, by_model: bool
) -> Explanation:
    """The explanation with its figures on a second recording, and what was left out of that. by_model: whether the
    given simulation is a model, which is simulated there like the others.

    Its further signals all stay: a read-back among them moves nothing, for no part of the first record is driven by it.
    A limit of PV that the model has too is simulated, and compared like the rest.
    """
    taken = taken_of(second)
    second = as_compared(second, taken)
    record = replace(record_of(second), first_s=0.0 if taken is None else taken.first_s)
    sensors = tuple(pattern.part for pattern in prepared.patterns)
    simulated = {part.block.name for part in lasting(sensors)}
    hidden = tuple(pattern for pattern in find_patterns(record) if pattern.part.block.name not in simulated)
    record = without_hidden(record, hidden)
    given = prepared.given if by_model else second.trace if prepared.given_trace is not None else None
    rest = rest_along(prepared, record, second.trace)
    lacking = rest_unknown(prepared, selection.fit) if rest is None else Lacking()
    record = record if rest is None else record.resting(rest)
    judged = None if lacking.too_much else validate(prepared.base, selection.fit, sensors, record, given)
    said = tuple(Reason(note.code, f"in the second recording: {note.text}") for note in second.notes)
    said += far_apart(prepared.record, record)
    said += given_on_one_alone(prepared.given_trace is not None, given is not None or second.trace is not None)
    return replace(explanation, validation=judged, evidence=(*explanation.evidence, *said, *lacking.said))


def far_apart(first: Experiment, second: Experiment) -> tuple[Reason, ...]:
    """That a second recording is hardly of the same loop in the same units, by its OP and PV."""
    sides = (("OP", first.op, second.op), ("PV", first.pv, second.pv))
    said = [
        f"{name} is {in_range(two)}, in the first {in_range(one)}" for name, one, two in sides if elsewhere(one, two)
    ]
    if not said:
        return ()
    text = f"the second recording is far from the first: {'; '.join(said)}; is it of the same loop, in the same units?"
    return (Reason("second_elsewhere", text),)


def elsewhere(one: FloatArray, other: FloatArray) -> bool:
    """Whether two signals go OTHER_UNIT times as far as each other, or are farther apart than that."""
    wide, narrow = sorted((span(one), span(other)), reverse=True)
    return wide > OTHER_UNIT * narrow or abs(float(np.median(one) - np.median(other))) > OTHER_UNIT * wide


def in_range(signal: FloatArray) -> str:
    low, high = np.quantile(signal, (0.01, 0.99))
    return f"from {low:.4g} to {high:.4g}"


def given_on_one_alone(first: bool, second: bool) -> tuple[Reason, ...]:
    """Why nothing is said of a simulation as it came on the second recording, where it is there of one alone."""
    if first == second:
        return ()
    has, lacks = ("first", "second") if first else ("second", "first")
    text = f"there is a simulation of the {has} recording and none of the {lacks}: it is not judged on the second"
    return (Reason("given_not_validated", text),)


@dataclass(frozen=True, eq=False)
class Told:
    """An explanation, and the selection that it tells of."""

    explanation: Explanation
    selection: Selection


def assemble(comparison: Comparison, prepared: Prepared, tried: Weighed) -> Told:
    """Held-out figures, effects, windows, model and traces of a selection; of what is left of it where unseen data
    refuse it.
    """
    selection, refused = tried.selection, tried.refused
    usable = prepared.record.usable
    final = selection.fit
    held = kept_out(final, usable)
    seen = free_runs(prepared, final, held)
    traces = Traces(
        prepared.record.time_s,
        comparison.pv,
        given_run(comparison, prepared, held),
        seen.refitted,
        seen.explained,
        held,
    )
    improvement = improvement_of(traces, prepared.base)
    errors = unseen_errors(comparison.pv, seen)
    doubts = unseen_data_refuse(selection, errors, seen.gain)
    others = [other for other in stretches(usable) if doubts and not np.array_equal(other, held)]
    runs = [seen, *(free_runs(prepared, final, other) for other in others)]
    if doubts and mostly_worse(comparison.pv, runs):
        left = left_of(prepared, selection)
        return assemble(comparison, prepared, replace(left, refused=(*refused, *doubts, *left.refused)))
    conclusion = conclude(
        prepared.base,
        tuple(pattern_effect(p, prepared.record) for p in prepared.patterns),
        tuple(told for e in selection.effects for told in effects_of(e, final)),
        refused,
        improvement,
    )
    sensors = tuple(p.part for p in prepared.patterns)
    controller = None if comparison.simulation is None else comparison.simulation.controller
    closed = close_again(prepared.base, final, sensors, prepared.acted, prepared.given, controller)
    explanation = Explanation(
        name=comparison.name,
        verdict=conclusion.verdict,
        effects=merged(conclusion.effects),
        located=location_of(conclusion.effects) if conclusion.effects else at_the_controller(prepared.record, closed),
        fit=improvement,
        validation=None,
        model=export(seen.model, seen.sensors),
        refit=refit_estimates(prepared.base),
        evidence=(
            *comparison.notes,
            *conclusion.reasons,
            *held_out_worse(
                conclusion.effects, improvement, errors, seen.gain, [ran_worse(comparison.pv, r) for r in runs]
            ),
            *evidence_of(prepared, selection),
            *controller_evidence(prepared.record, closed),
            *yper_evidence(closed),
        ),
        traces=traces,
        closed_loop=closed,
        engine_version=ENGINE_VERSION,
    )
    return Told(explanation, selection)


def left_of(prepared: Prepared, selection: Selection) -> Weighed:
    """What is left of a selection that unseen data refuse: the first of two effects alone, weighed as any selection is;
    else the bare refit.
    """
    if selection.alone is not None:
        return weighed(prepared, selection.alone)
    return Weighed(Selection(prepared.base, (), selection.ranking))


def given_run(comparison: Comparison, prepared: Prepared, held: BoolArray) -> FloatArray | None:
    """The given simulation (N,), a trace as it came; a model, which says how PV moves and not where it stands, at the
    level of PV in the samples that are not `held` (N,) out.
    """
    run = prepared.given_trace
    if run is None or comparison.simulation is None or comparison.simulation.integrating:
        return run
    seen = prepared.record.usable & ~held
    return run + float(np.mean((comparison.pv - run)[seen])) if seen.any() else run


def sensors_of(found: Fit, patterns: tuple[Pattern, ...]) -> tuple[Part, ...]:
    """What sensor and historian do to the free run; rounding and compression only where that comes nearer to what was
    fitted.
    """
    signal, context = found.simulated, Context(found.record, found.plant)
    kept = []
    for pattern in patterns:
        through = seen_through(signal, (pattern.part,), context)
        if pattern.hides_pv or variance_left(found.record, through) <= variance_left(found.record, signal):
            signal = through
            kept.append(pattern.part)
    return tuple(kept)


def variance_left(record: Experiment, signal: FloatArray) -> float:
    """Variance of what a simulation (N,) leaves of PV where it is compared; 0 where nothing is."""
    left = (record.pv_deviation - signal)[record.usable]
    return float(np.var(left)) if len(left) else 0.0


def seen_through(signal: FloatArray, sensors: tuple[Part, ...], context: Context) -> FloatArray:
    for part in sensors:
        if part.block.apply is not None:
            signal = part.block.apply(signal, part.values, context)
    return signal


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


def free_runs(prepared: Prepared, final: Fit, held: BoolArray) -> FreeRuns:
    """The refit and the explained model, both fitted without the samples `held` (N,), over the whole record."""
    base_seen = refit_without(prepared.base, held)
    final_seen = refit_without(final, held, base_seen.given if final.given is prepared.base.given else None)
    sensors = sensors_of(final_seen, prepared.patterns)
    explained = seen_through(final_seen.simulated, sensors, Context(final.record, final.plant))
    mid = prepared.record.pv_mid
    gain = unseen_gain(base_seen, final_seen, held)
    return FreeRuns(base_seen.simulated + mid, explained + mid, held, gain, final_seen, sensors)


def improvement_of(traces: Traces, base: Fit) -> Improvement:
    held, record = traces.held_out, base.record
    late = round(base.plant.theta / record.sampling_interval_s)

    def judged(run: FloatArray) -> FitMeasures:
        tests = residual_tests(traces.pv - run, record.op, record.usable, held, late)
        return replace(judge(traces.pv, run, held), tests=tests)

    given = None if traces.given is None else judged(traces.given)
    refitted, explained = judged(traces.refitted), judged(traces.explained)
    return Improvement(given, refitted, explained, windows_along(record, held))


def in_words(found: Fit) -> str:
    """The linear loop of a fit."""
    return ", ".join(f"{e.name} {e.value:.4g} {e.unit}" for e in refit_estimates(found))


def evidence_of(prepared: Prepared, selection: Selection) -> tuple[Reason, ...]:
    """What the refit alone explained, and how near the best effect that was not believed came."""
    base = prepared.base
    own = base.given.own
    whose = "no simulation was given; our own linear loop" if own else "the simulation's own parameters, fitted"
    said = [*prepared.off, Reason("refit", f"{whose}: {in_words(base)}")]
    if selection.fit.given.behind_stem:
        said.append(Reason("own_loop", f"behind the stem our own linear loop is another: {in_words(selection.fit)}"))
    if base.parts:
        said.append(Reason("own_dynamics", "no simulation was given, and our own loop needed more lags than two"))
    best = selection.ranking[0] if selection.ranking and not selection.effects else None
    if best is not None and best.gain < best.block.penalty:
        said.append(
            Reason(
                "no_effect_pays",
                f"the best effect, {best.block.code}, adds {best.gain:.1f} points of log-likelihood, where "
                f"{best.block.penalty:.1f} are asked",
            )
        )
    return tuple(said)
