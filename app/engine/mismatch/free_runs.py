"""Refit and explained model run over the whole record without PV, behind sensor and historian, and how well they do."""

from dataclasses import replace

import numpy as np

from app.engine.mismatch.compare.comparison import Comparison
from app.engine.mismatch.compare.patterns import Pattern
from app.engine.mismatch.compare.preparing import Prepared
from app.engine.mismatch.fit.bending import bent_without
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.windows import windows_along
from app.engine.mismatch.judge.holdout import FitMeasures, FreeRuns, judge, refit_without, unseen_gain
from app.engine.mismatch.judge.residuals import residual_tests
from app.engine.mismatch.judge.result import Improvement, Traces
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.recording import BoolArray, FloatArray


def free_runs(prepared: Prepared, final: Fit, held: BoolArray) -> FreeRuns:
    """The refit and the explained model, both fitted without the samples `held` (N,), over the whole record."""
    base_seen = refit_without(bent_without(prepared.base, prepared.bent, held), held)
    given = base_seen.given if final.given is prepared.base.given else None
    final_seen = refit_without(bent_without(final, prepared.bent, held), held, given)
    sensors = _sensors_of(final_seen, prepared.patterns)
    explained = _seen_through(final_seen.simulated, sensors, Context(final.record, final.plant))
    mid = prepared.record.pv_mid
    gain = unseen_gain(base_seen, final_seen, held)
    return FreeRuns(base_seen.simulated + mid, explained + mid, held, gain, final_seen, sensors)


def given_run(comparison: Comparison, prepared: Prepared, held: BoolArray) -> FloatArray | None:
    """The given simulation (N,), a trace as it came; a model, which says how PV moves and not where it stands, at the
    level of PV in the samples that are not `held` (N,) out.
    """
    run = prepared.given_trace
    if run is None or comparison.simulation is None or comparison.simulation.integrating:
        return run
    seen = prepared.record.usable & ~held
    return run + float(np.mean((comparison.pv - run)[seen])) if seen.any() else run


def improvement_of(traces: Traces, base: Fit) -> Improvement:
    held, record = traces.held_out, base.record
    late = round(base.plant.theta / record.sampling_interval_s)

    def judged(run: FloatArray) -> FitMeasures:
        tests = residual_tests(traces.pv - run, record.op, record.usable, held, late)
        return replace(judge(traces.pv, run, held), tests=tests)

    given = None if traces.given is None else judged(traces.given)
    refitted, explained = judged(traces.refitted), judged(traces.explained)
    return Improvement(given, refitted, explained, windows_along(record, held))


def _sensors_of(found: Fit, patterns: tuple[Pattern, ...]) -> tuple[Part, ...]:
    """What sensor and historian do to the free run; rounding and compression only where that comes nearer to what was
    fitted.
    """
    signal, context = found.simulated, Context(found.record, found.plant)
    kept = []
    for pattern in patterns:
        through = _seen_through(signal, (pattern.part,), context)
        if pattern.hides_pv or _variance_left(found.record, through) <= _variance_left(found.record, signal):
            signal = through
            kept.append(pattern.part)
    return tuple(kept)


def _variance_left(record: Experiment, signal: FloatArray) -> float:
    """Variance of what a simulation (N,) leaves of PV where it is compared; 0 where nothing is."""
    left = (record.pv_deviation - signal)[record.usable]
    return float(np.var(left)) if len(left) else 0.0


def _seen_through(signal: FloatArray, sensors: tuple[Part, ...], context: Context) -> FloatArray:
    for part in sensors:
        if part.block.apply is not None:
            signal = part.block.apply(signal, part.values, context)
    return signal
