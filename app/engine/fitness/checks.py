"""The checks, each one a row of evidence: statistic, threshold, outcome and the reason in words."""

from typing import cast

import numpy as np

from app.counting import counted, counted_times
from app.engine.codes import CheckCode
from app.engine.evidence import Finding, Operator, Outcome
from app.engine.fitness.config import FitnessConfig
from app.engine.fitness.holes import Unbroken
from app.engine.fitness.signals import (
    at_extremes,
    at_limits,
    on_line_share,
    quantisation_step,
    run_lengths,
    stored_points,
    two_levels,
)
from app.engine.fitness.skew import Skew
from app.engine.fitness.standstill import Standstill
from app.engine.oscillation import Oscillation
from app.engine.recording import BoolArray, FloatArray, Span, UniformRecord

# So many values that were taken as missing are told.
MOST_TOLD = 5

# A recording that fails one of these is not audited; the other findings only say how good it is.
BLOCKING: frozenset[CheckCode] = frozenset(
    {"too_short", "missing_values", "not_in_automatic", "gaps", "filled", "op_flat", "pv_flat", "op_two_values",
     "op_at_limits", "samples_per_cycle"}
)  # fmt: skip

# Of these, the ones that more samples of the same kind mend.
OF_LENGTH: frozenset[CheckCode] = frozenset({"too_short", "missing_values", "not_in_automatic", "gaps"})


def not_evaluated(code: CheckCode, because: str) -> Finding:
    """A check that could not be made, with the reason: it is neither good nor missing."""
    return Finding(code, "not_evaluated", f"not evaluated, because {because}")


def check_length(samples: int, config: FitnessConfig, repeats: int = 1) -> Finding:
    enough = samples >= config.min_samples
    stored = f", each of them stored {repeats} times" if repeats > 1 else ""
    text = f"{counted(samples, 'sample')}{stored}; at least {config.min_samples} are needed"
    return _finding("too_short", enough, text, samples, config.min_samples, "samples", ">=")


def check_missing(both: BoolArray, interpolated: str | None, config: FitnessConfig) -> Finding:
    """both: (N,) True where PV and OP have a value. interpolated: the signal that was brought to the other's times."""
    usable, share = int(np.sum(both)), 1.0 - float(np.mean(both))
    of_all = counted(len(both), "sample")
    text = f"PV and OP both have a value in {usable:,} of {of_all}; at least {config.min_samples} are needed"
    if interpolated is not None:
        text += f"; their time stamps differ, so {interpolated} is interpolated"
    return _finding("missing_values", usable >= config.min_samples, text, share, None, "share")


def check_wild(pv: FloatArray, op: FloatArray) -> Finding:
    """pv, op: the values of each that count as missing because they lie alone and far off."""
    found = [_told_wild(name, values) for name, values in (("PV", pv), ("OP", op)) if len(values)]
    if found:
        text = f"isolated samples far from all others are treated as missing: {' and '.join(found)}"
    else:
        text = "no value of PV or OP is isolated and far outside its range"
    return _finding("wild_samples", not found, text, len(pv) + len(op), 0.0, "samples", "<=")


def _told_wild(name: str, values: FloatArray) -> str:
    told = ", ".join(f"{value:.10g}" for value in values[:MOST_TOLD])
    more = ", .." if len(values) > MOST_TOLD else ""
    return f"{len(values)} of {name} ({told}{more})"


def check_automatic(automatic: BoolArray | None, kept: int, later: int, config: FitnessConfig) -> Finding:
    """kept: samples in the stretch in automatic that is judged; later: those that came after."""
    if automatic is None:
        return not_evaluated("not_in_automatic", "the mode was not recorded")
    share = float(np.mean(automatic)) if len(automatic) else 0.0
    text = (
        f"in automatic, by its recorded mode, for {100 * share:.1f} % of the samples, {kept:,} of them in a row; "
        f"at least {config.min_samples} in a row are needed"
    )
    text += f"; {_after(later, 'them')}" if later and kept else ""
    return _finding("not_in_automatic", kept >= config.min_samples, text, share, None, "share")


def check_gaps(unbroken: Unbroken, kept: int, samples: int, later: int, config: FitnessConfig) -> Finding:
    """kept: samples in the stretch that is judged, of so many; later: those that came after."""
    gaps, most = unbroken.holes, f"{unbroken.most_filled:.3g} sampling intervals"
    if gaps == 0:
        text = f"no hole is longer than {most}"
    else:
        text = (
            f"{counted(gaps, f'hole longer than {most} splits', f'holes longer than {most} split')} the record; the "
            f"newest of its long stretches has {kept:,} of {counted(samples, 'sample')}; at least "
            f"{config.min_samples} are needed"
        )
        text += f"; {_after(later, 'it')}" if later else ""
    return _finding("gaps", kept >= config.min_samples, text, gaps, None, "holes")


def _after(later: int, what: str) -> str:
    return f"the sample after {what} is not used" if later == 1 else f"the {later:,} samples after {what} are not used"


def check_flat(name: str, signal: FloatArray, meaning: str, kept: int, config: FitnessConfig) -> Finding:
    """name: pv or op. kept: samples in the stretch that is judged, where neither signal is dead."""
    share = float(run_lengths(signal).max() / len(signal))
    dead = share >= config.flat_share
    text = f"{name.upper()} holds one value for {100 * share:.1f} % of the stretch"
    if dead:
        remain = counted(kept, "sample in a row remains", "samples in a row remain")
        text += f": {meaning}; {remain}; at least {config.min_samples} are needed"
    usable = not dead or kept >= config.min_samples
    operator: Operator | None = None if dead and usable else "<"  # then what remains decides
    return _finding(_of(name, "flat"), usable, text, share, config.flat_share, "share", operator)


def pv_stands(found: Standstill) -> Finding:
    """In place of how long PV holds one value at most: what it does by now, whatever share of the record that is."""
    text = f"{found.text}: a stuck valve or a dead transmitter"
    return Finding("pv_flat", "fail", text, found.for_s / 3600.0, None, "h")


def check_two_values(op: FloatArray, config: FitnessConfig) -> Finding:
    """OP that is switched between two values shows nothing of how a valve follows it."""
    at = two_levels(op)
    share = at.more + at.less
    both = at.less >= config.least_of_two_values and at.switches >= config.fewest_switches
    switched = both and share >= config.two_values_share and at.on_the_way <= config.most_on_the_way
    text = (
        f"OP is at one of two values for {100 * share:.1f} % of the stretch, and switched {counted_times(at.switches)}"
    )
    text += ": on/off control, or an OP stored too coarsely" if switched else ""
    return _finding("op_two_values", not switched, text, share, config.two_values_share, "share")


def check_op_limits(op: FloatArray, op_range: Span | None, two_values: Finding, config: FitnessConfig) -> Finding:
    """OP at one limit of its span, or, where the span is not known, at its own least or greatest value."""
    if two_values.outcome == "fail":
        return not_evaluated("op_at_limits", "OP is switched between two values")
    at_limit = at_limits(op, op_range, config.op_limit_band)
    low, high = at_limit or at_extremes(op)
    share = max(float(np.mean(low)), float(np.mean(high)))
    where = "the end of its span" if at_limit else "its own extreme value (the span is not known)"
    text = f"OP is at {where} for {100 * share:.1f} % of the stretch"
    return _finding("op_at_limits", share < config.op_limit_share, text, share, config.op_limit_share, "share", "<")


def check_sampling(regular: bool, record: UniformRecord, repeats: int = 1) -> Finding:
    """Irregular sampling does not refuse a record; how much had to be filled may."""
    if regular:
        text = f"one sample every {record.sampling_interval_s:g} s, used as recorded"
    else:
        text = f"irregular sampling, interpolated linearly to one sample every {record.sampling_interval_s:g} s"
    text += f"; each was stored {repeats} times" if repeats > 1 else ""
    return _finding("irregular_sampling", regular, text, float(regular), None, "")


def check_filled(record: UniformRecord, config: FitnessConfig) -> Finding:
    share = float(np.mean(record.filled))
    text = f"{100 * share:.1f} % of the samples were filled by interpolation"
    return _finding("filled", share <= config.max_filled_share, text, share, config.max_filled_share, "share", "<=")


def check_levels(name: str, signal: FloatArray, config: FitnessConfig) -> Finding:
    step = quantisation_step(signal)
    if step is None:
        return not_evaluated(_of(name, "quantised"), f"{name.upper()} does not move")
    levels = float(np.ptp(signal)) / step
    text = f"the range of {name.upper()} is {levels:.4g} times its smallest step"
    code = _of(name, "quantised")
    return _finding(code, levels >= config.min_levels, text, levels, config.min_levels, "steps", ">=")


def check_on_line(name: str, signal: FloatArray, config: FitnessConfig) -> Finding:
    share = on_line_share(signal)
    text = f"{100 * share:.1f} % of the {name.upper()} samples lie on a straight line between their neighbours"
    if share > config.max_on_line_share:
        text += ": compressed or interpolated by the historian"
    code = _of(name, "interpolated")
    return _finding(code, share <= config.max_on_line_share, text, share, config.max_on_line_share, "share", "<=")


def check_skew(skew: Skew | None, record: UniformRecord) -> Finding:
    """A skew refuses nothing: it is set right."""
    if skew is None:
        return not_evaluated("time_skew", "OP does not show at once what is new in PV")
    apart = f"{counted(abs(skew.samples), 'sample')} ({abs(skew.samples) * record.sampling_interval_s:.4g} s)"
    if skew.samples == 0:
        text = "PV and OP have the same time stamps"
    elif skew.samples < 0:
        text = (
            f"OP responds {apart} before PV shows the cause: PV is stamped late, or OP early or fed forward; corrected"
        )
    else:
        text = f"OP responds {apart} after PV shows the cause: OP is stamped late, or PV early; corrected"
    return _finding("time_skew", skew.samples == 0, text, skew.samples, None, "samples")


def check_samples_per_cycle(oscillation: Oscillation, config: FitnessConfig) -> Finding:
    per_cycle = oscillation.samples_per_cycle
    if per_cycle is None or not oscillation.regular:
        # The period of noise is a few samples whatever the sampling interval.
        return not_evaluated("samples_per_cycle", "no regular oscillation was found")
    enough = per_cycle >= config.min_samples_per_cycle
    text = f"{per_cycle:.3g} samples per cycle; at least {config.min_samples_per_cycle:g} are needed"
    return _finding("samples_per_cycle", enough, text, per_cycle, config.min_samples_per_cycle, "samples", ">=")


def check_cycles(oscillation: Oscillation, record: UniformRecord, config: FitnessConfig) -> Finding:
    per_cycle = oscillation.samples_per_cycle
    if per_cycle is None:
        return not_evaluated("few_cycles", "no oscillation was found")
    cycles = record.samples / per_cycle
    text = f"the stretch holds {cycles:.3g} cycles; at least {config.min_cycles:g} are needed to judge"
    return _finding("few_cycles", cycles >= config.min_cycles, text, cycles, config.min_cycles, "cycles", ">=")


def check_stored_points(oscillation: Oscillation, record: UniformRecord, config: FitnessConfig) -> Finding:
    """Points a cycle that the historian really stored: values that change, and not on a straight line."""
    per_cycle = oscillation.samples_per_cycle
    if per_cycle is None or not oscillation.regular:
        return not_evaluated("stored_points", "no regular oscillation was found")
    points = stored_points(record.pv) * per_cycle / record.samples
    text = f"{points:.3g} points of PV per cycle were stored; the rest is held or lies on lines between them"
    enough = points >= config.min_stored_points
    if not enough:
        text += f"; below {config.min_stored_points:g} the shape is the historian's own"
    return _finding("stored_points", enough, text, points, config.min_stored_points, "points", ">=")


def refusals(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """The findings for which a recording is not audited."""
    return tuple(finding for finding in findings if finding.outcome == "fail" and finding.code in BLOCKING)


def _of(name: str, what: str) -> CheckCode:
    """The code of a check that is made of PV and of OP. name: pv or op."""
    return cast(CheckCode, f"{name}_{what}")


def _finding(
    code: CheckCode,
    passed: bool,
    text: str,
    statistic: float,
    threshold: float | None,
    unit: str,
    operator: Operator | None = None,
) -> Finding:
    outcome: Outcome = "pass" if passed else "fail"
    limit = None if threshold is None else float(threshold)
    return Finding(code, outcome, text, float(statistic), limit, unit, operator)
