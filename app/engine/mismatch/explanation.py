"""From a recording and a simulation to an explanation: the one function that walks the whole way."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine import ENGINE_VERSION
from app.engine.evidence import Reason
from app.engine.mismatch.compare.comparison import Comparison, mended, record_of
from app.engine.mismatch.compare.preparing import Prepared, prepare
from app.engine.mismatch.compare.read_back import without_read_backs
from app.engine.mismatch.compare.sampling import as_compared, taken_of
from app.engine.mismatch.compete.selection import Selection
from app.engine.mismatch.fit.closed_loop import ClosedLoop, close_again
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.free_run import settle
from app.engine.mismatch.free_runs import free_runs, given_run, improvement_of
from app.engine.mismatch.judge.conclude import conclude, held_out_worse, op_moves_nothing, unseen_data_refuse
from app.engine.mismatch.judge.controller import at_the_controller, controller_evidence, yper_evidence
from app.engine.mismatch.judge.doubting import reviewed
from app.engine.mismatch.judge.holdout import (
    FreeRuns,
    Unseen,
    kept_out,
    mostly_worse,
    ran_worse,
    stretches,
    unseen_errors,
)
from app.engine.mismatch.judge.result import Effect, Explanation, Traces
from app.engine.mismatch.missing import compete
from app.engine.mismatch.report import effects_of, export, location_of, pattern_effect, refit_estimates
from app.engine.mismatch.second_recording import mended_second, validated
from app.engine.recording import FloatArray


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
    told = _assemble(comparison, prepared, _weighed(prepared, competed.selection))
    if second is None:
        return told.explanation
    by_model = comparison.simulation is not None
    return validated(told.explanation, prepared, told.selection, second, by_model=by_model)


@dataclass(frozen=True, eq=False)
class _Weighed:
    """A selection that stands on the record that it was fitted to, and why what was named before it does not."""

    selection: Selection
    refused: tuple[Reason, ...] = ()


def _weighed(prepared: Prepared, selection: Selection) -> _Weighed:
    """The selection, its names less sure for what they leave, its numbers by its free run where noise took that up;
    nothing of it where OP does not move PV.
    """
    asked = selection if prepared.unrelated else reviewed(prepared.base, selection)
    asked = replace(asked, fit=settle(asked.fit))
    doubts = prepared.unrelated or (op_moves_nothing(asked.fit) if asked.effects else ())
    return _Weighed(Selection(prepared.base, (), asked.ranking), doubts) if doubts else _Weighed(asked)


@dataclass(frozen=True, eq=False)
class _Told:
    """An explanation, and the selection that it tells of."""

    explanation: Explanation
    selection: Selection


@dataclass(frozen=True, eq=False)
class _HeldOut:
    """How a selection does on samples that it was not fitted to.

    seen: its runs with the first stretch left out. runs: these, and those with others left out where the first refuses
    it. errors: of the first, refit and explained. doubts: why it refuses the selection; empty: it does not.
    """

    seen: FreeRuns
    runs: tuple[FreeRuns, ...]
    errors: Unseen
    doubts: tuple[Reason, ...]


def _held_out_of(pv: FloatArray, prepared: Prepared, selection: Selection) -> _HeldOut:
    """pv: (N,) as it was recorded."""
    final, usable = selection.fit, prepared.record.usable
    held = kept_out(final, usable)
    seen = free_runs(prepared, final, held)
    errors = unseen_errors(pv, seen)
    doubts = unseen_data_refuse(selection, errors, seen.gain)
    others = [other for other in stretches(usable) if doubts and not np.array_equal(other, held)]
    return _HeldOut(seen, (seen, *(free_runs(prepared, final, other) for other in others)), errors, doubts)


def _assemble(comparison: Comparison, prepared: Prepared, tried: _Weighed) -> _Told:
    """The explanation by a selection; by what is left of it where unseen data refuse it."""
    selection = tried.selection
    held_out = _held_out_of(comparison.pv, prepared, selection)
    if held_out.doubts and mostly_worse(comparison.pv, held_out.runs):
        left = _left_of(prepared, selection)
        return _assemble(comparison, prepared, replace(left, refused=(*tried.refused, *held_out.doubts, *left.refused)))
    return _Told(_explanation_by(comparison, prepared, tried, held_out), selection)


def _explanation_by(comparison: Comparison, prepared: Prepared, tried: _Weighed, held_out: _HeldOut) -> Explanation:
    """Held-out figures, effects, windows, model and traces of a selection."""
    selection, seen = tried.selection, held_out.seen
    given = given_run(comparison, prepared, seen.held)
    traces = Traces(prepared.record.time_s, comparison.pv, given, seen.refitted, seen.explained, seen.held)
    improvement = improvement_of(traces, prepared.base)
    conclusion = conclude(
        prepared.base,
        tuple(pattern_effect(p, prepared.record) for p in prepared.patterns),
        tuple(told for e in selection.effects for told in effects_of(e, selection.fit)),
        tried.refused,
        improvement,
    )
    worse = [ran_worse(comparison.pv, run) for run in held_out.runs]
    closed = _closed_by(comparison, prepared, selection.fit)
    return Explanation(
        name=comparison.name,
        verdict=conclusion.verdict,
        effects=_merged(conclusion.effects),
        located=location_of(conclusion.effects) if conclusion.effects else at_the_controller(prepared.record, closed),
        fit=improvement,
        validation=None,
        model=export(seen.model, seen.sensors),
        refit=refit_estimates(prepared.base),
        evidence=(
            *comparison.notes,
            *conclusion.reasons,
            *held_out_worse(conclusion.effects, improvement, held_out.errors, seen.gain, worse),
            *_evidence_of(prepared, selection),
            *controller_evidence(prepared.record, closed),
            *yper_evidence(closed),
        ),
        traces=traces,
        closed_loop=closed,
        engine_version=ENGINE_VERSION,
    )


def _closed_by(comparison: Comparison, prepared: Prepared, final: Fit) -> ClosedLoop | None:
    sensors = tuple(pattern.part for pattern in prepared.patterns)
    controller = None if comparison.simulation is None else comparison.simulation.controller
    return close_again(prepared.base, final, sensors, prepared.acted, prepared.given, controller)


def _left_of(prepared: Prepared, selection: Selection) -> _Weighed:
    """What is left of a selection that unseen data refuse: the first of two effects alone, weighed as any selection is;
    else the bare refit.
    """
    if selection.alone is not None:
        return _weighed(prepared, selection.alone)
    return _Weighed(Selection(prepared.base, (), selection.ranking))


def _merged(effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
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


def _in_words(found: Fit) -> str:
    """The linear loop of a fit."""
    return ", ".join(f"{e.name} {e.value:.4g} {e.unit}" for e in refit_estimates(found))


def _evidence_of(prepared: Prepared, selection: Selection) -> tuple[Reason, ...]:
    """What the refit alone explained, and how near the best effect that was not believed came."""
    base = prepared.base
    own = base.given.own
    whose = "no simulation was given; our own linear loop" if own else "the simulation's own parameters, fitted"
    said = [*prepared.off, Reason("refit", f"{whose}: {_in_words(base)}")]
    if selection.fit.given.behind_stem:
        said.append(Reason("own_loop", f"driven by the stem, our own linear loop differs: {_in_words(selection.fit)}"))
    if base.parts:
        said.append(Reason("own_dynamics", "no simulation was given, and our own loop needed more than two lags"))
    best = selection.ranking[0] if selection.ranking and not selection.effects else None
    if best is not None and best.gain < best.block.penalty:
        said.append(
            Reason(
                "no_effect_pays",
                f"the best effect, {best.block.code}, adds {best.gain:.1f} points of log-likelihood; "
                f"{best.block.penalty:.1f} are required",
            )
        )
    return tuple(said)
