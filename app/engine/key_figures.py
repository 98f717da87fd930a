"""Key figures that engineers expect of a loop monitor, over good samples only: each with its definition and source."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numba import njit

from app.engine.fitness import FitnessConfig
from app.engine.fitness.align import align
from app.engine.fitness.repeated import once_a_scan
from app.engine.fitness.resample import lasting
from app.engine.fitness.signals import (
    at_extremes,
    at_limits,
    on_line_share,
    quantisation_step,
    resolution,
    usable_values,
)
from app.engine.oscillation import autocorrelation
from app.engine.recording import BoolArray, FloatArray, IntArray, Recording, Span, known_span
from app.engine.signals.sampled import held
from app.engine.timed import Timed, holding_times

FEWEST_STEPS = 10
"""Steps of its resolution below which OP's own extremes say nothing of limits."""

REVERSAL_SHARE = 0.02
"""A reversal counts once OP has come back by this share of its range (5th to 95th percentile): noise is no travel."""

SHORTEST_FOR_RESPONSE = 100
"""Samples below which the autocorrelation says little about how long an upset is felt."""

HARRIS_TERMS = 20
"""Autoregressive terms of the minimum-variance benchmark; Desborough and Harris 1992 use 5 to 30."""

HARRIS_HORIZON = 5
"""Samples of dead time that the benchmark assumes of every loop, whatever its process and its sampling interval."""


@dataclass(frozen=True)
class KeyFigures:
    """Plain figures of a loop over the good samples of a record; None where a figure cannot be had, never 0 instead.

    Shares, means, deviations and percentiles are over time: each sample counts for as long as it holds (`timed`).

    good_share_pct: samples with PV and OP, of all samples; their number, not their time.
    service_factor_pct: good time in automatic, of all good time; None where the mode was not recorded.
    op_saturation_pct: time in automatic with OP within 0.5 % of an end of its span; None without a known span.
    op_at_extreme_pct: time in automatic with OP at the one of its own extremes where it stands longer; None where its
    span is known and where its range is below ten of its steps.
    error_mean, error_std, error_abs_mean, error_abs_p95: SP - PV in the unit of PV; None without a set point.
    error_p05, error_median, error_p95: percentiles of SP - PV, its distribution in three numbers, in the unit of PV.
    error_abs_mean_pct_of_span: mean of abs(SP - PV) in per cent of PV's span; None without a known span.
    variability_pct: 2 std(PV) / abs(mean(PV)) in per cent; None where PV's mean is small against its spread.
    pv_std, op_std: standard deviations in the signals' units.
    op_travel_per_h: sum of abs(OP changes) an hour, in the unit of OP, changes below the reversal band left out.
    op_reversals_per_h: changes of OP's direction an hour that exceed the reversal band.
    op_travel_pct_of_span_per_h: the travel in per cent of OP's span; None without a known span.
    response_time_s: lag at which the autocorrelation of the control error falls below 1/e; None where it never does.
    harris_index: minimum over present variance of the control error, 0 (poor) to 1 (no better control possible), over
    samples that follow each other without a hole, a missing value or a spell in manual between them; None where a
    historian drew PV's samples on straight lines, which foretell themselves: a loop at 1 of which every tenth sample
    was kept would stand at 0.15.
    harris_horizon_samples: the dead time, in samples, that the index assumes: HARRIS_HORIZON, of every loop.
    """

    good_share_pct: float
    service_factor_pct: float | None
    op_saturation_pct: float | None
    op_at_extreme_pct: float | None
    error_mean: float | None
    error_std: float | None
    error_abs_mean: float | None
    error_abs_p95: float | None
    error_p05: float | None
    error_median: float | None
    error_p95: float | None
    error_abs_mean_pct_of_span: float | None
    variability_pct: float | None
    pv_std: float | None
    op_std: float | None
    op_travel_per_h: float | None
    op_reversals_per_h: float | None
    op_travel_pct_of_span_per_h: float | None
    response_time_s: float | None
    harris_index: float | None
    harris_horizon_samples: int


def compute(recording: Recording, config: FitnessConfig | None = None) -> KeyFigures:
    """The key figures of one recording.

    recording: PV, OP and SP in engineering units, NaN where missing. config: by which its samples are checked, the
    audit's; None: the defaults.

    Of a scan that was stored several times one sample counts, of these only those with finite PV and OP, and not the
    wild ones among them; where PV and OP were stamped at different times, they are brought together as they are for the
    audit, and the set point is held. Control error, saturation and Harris index use those in automatic where the mode
    is known. The Harris index assumes a dead time of
    HARRIS_HORIZON samples, says less the further the loop's own is from that, and punishes loops that follow a moving
    set point or that are meant to let a level swing: compare a loop with itself.
    Sources: Jelali 2013, Control Performance Management in Industrial Automation, doi 10.1007/978-1-4471-4546-2
    (figures); Harris 1989, Can. J. Chem. Eng. 67, 856, doi 10.1002/cjce.5450670519, and Desborough and Harris 1992,
    doi 10.1002/cjce.5450700620 (index); Thornhill, Choudhury, Shah 2004, J. Process Control 14, 389-398 (what a
    historian's compression does to it).
    """
    config = config or FitnessConfig()
    recording, good = _together(once_a_scan(recording, config).recording, config)
    held_s = holding_times(recording.time_s, config)

    def timed(signal: FloatArray, part: BoolArray) -> Timed:
        return Timed(signal[part], None if held_s is None else held_s[part])

    used = good if recording.automatic is None else good & recording.automatic
    tracked = np.zeros_like(used) if recording.sp is None else used & usable_values(recording.sp)
    error = Timed(np.empty(0), None) if recording.sp is None else timed(recording.sp - recording.pv, tracked)
    controlled = np.flatnonzero(tracked if len(error) else used)
    upset = error.values if len(error) else recording.pv[used]
    pv, op, op_used = timed(recording.pv, good), timed(recording.op, good), timed(recording.op, used)
    drawn = on_line_share(recording.pv[controlled]) > config.max_on_line_share
    size = error.of(np.abs)
    each_s = _each_held(recording.time_s, held_s)
    travel, reversals = _travel(recording, good, config)
    low, median, high = error.percentiles((5.0, 50.0, 95.0))
    return KeyFigures(
        good_share_pct=100.0 * float(good.mean()) if recording.samples else 0.0,
        service_factor_pct=_service_factor_pct(recording.automatic, good, pv),
        op_saturation_pct=_saturation_pct(op_used, recording.op_range),
        op_at_extreme_pct=_at_extreme_pct(op_used) if known_span(recording.op_range) is None else None,
        error_mean=error.mean(),
        error_std=error.std(),
        error_abs_mean=size.mean(),
        error_abs_p95=size.percentiles((95.0,))[0],
        error_p05=low,
        error_median=median,
        error_p95=high,
        error_abs_mean_pct_of_span=_pct_of_span(size.mean(), recording.pv_range),
        variability_pct=_variability_pct(pv),
        pv_std=pv.std(),
        op_std=op.std(),
        op_travel_per_h=travel,
        op_reversals_per_h=reversals,
        op_travel_pct_of_span_per_h=_pct_of_span(travel, recording.op_range),
        response_time_s=_response_time_s(upset, each_s[controlled]),
        harris_index=None if drawn else _harris_index(upset, _runs(controlled, recording.time_s, config)),
        harris_horizon_samples=HARRIS_HORIZON,
    )


def _together(recording: Recording, config: FitnessConfig) -> tuple[Recording, BoolArray]:
    """The recording at the times at which PV and OP are known together, and which of its samples are good."""
    found = align(recording, config)
    if found.interpolated is None:
        return recording, found.both
    at = usable_values(recording.op if found.interpolated == "PV" else recording.pv)
    time_s, sp = recording.time_s, recording.sp
    if sp is not None and usable_values(sp).any():
        known = usable_values(sp)
        sp = held(time_s[known], sp[known], time_s)
    brought = replace(
        recording,
        time_s=time_s[at],
        pv=found.pv[at],
        op=found.op[at],
        sp=None if sp is None else sp[at],
        automatic=None if recording.automatic is None else recording.automatic[at],
        others={},
    )
    return brought, found.both[at]


def _service_factor_pct(automatic: BoolArray | None, good: BoolArray, pv: Timed) -> float | None:
    return None if automatic is None or not len(pv) else 100.0 * pv.share(automatic[good])


def _pct_of_span(value: float | None, span: Span | None) -> float | None:
    known = known_span(span)
    return None if value is None or known is None else 100.0 * value / (known[1] - known[0])


def _each_held(time_s: FloatArray, held_s: FloatArray | None) -> FloatArray:
    """(N,) in s for how long each sample holds, also where all do for equally long."""
    if held_s is not None:
        return held_s
    span_s = float(time_s[-1] - time_s[0]) if len(time_s) > 1 else 0.0
    return np.full(len(time_s), span_s / max(len(time_s) - 1, 1))


def _response_time_s(error: FloatArray, held_s: FloatArray) -> float | None:
    """How long an upset is felt: where the autocorrelation of the error (N,) first falls below 1/e, in samples that
    hold for held_s (N,) on average.

    Gaps are closed up, so that a record with long gaps gives a value that is too short.
    """
    if len(error) < SHORTEST_FOR_RESPONSE or np.ptp(error) <= resolution(error):
        return None
    below = np.flatnonzero(autocorrelation(error) < np.exp(-1.0))
    # At no lag at all it is 1, or 0 where the square of the error is too small a number.
    return None if len(below) == 0 or below[0] == 0 else float(below[0] * held_s.mean())


def _saturation_pct(op: Timed, op_range: Span | None) -> float | None:
    at_limit = at_limits(op.values, op_range)
    return None if at_limit is None or not len(op) else 100.0 * op.share(at_limit[0] | at_limit[1])


def _at_extreme_pct(op: Timed) -> float | None:
    step = quantisation_step(op.values) if len(op) else None
    # A signal of a few values is at its least or greatest for much of the time whatever it does.
    if step is None or np.ptp(op.values) < FEWEST_STEPS * step:
        return None
    return 100.0 * max(op.share(there) for there in at_extremes(op.values))


def _variability_pct(pv: Timed) -> float | None:
    mean, std = pv.mean(), pv.std()
    if mean is None or std is None:
        return None
    # About a mean near zero (deviation variables, temperatures around 0) the ratio says nothing.
    return 200.0 * std / abs(mean) if abs(mean) > std else None


def _travel(recording: Recording, good: BoolArray, config: FitnessConfig) -> tuple[float, float] | tuple[None, None]:
    """(travel, reversals) an hour that was recorded: within a hole OP neither moved nor rested. None where no two good
    samples are without a hole between them.
    """
    time_s, op = recording.time_s[good], np.ascontiguousarray(recording.op[good])
    if len(op) < 2:
        return None, None
    low, high = np.percentile(op, [5.0, 95.0])
    band, hours, travel, reversals = REVERSAL_SHARE * float(high - low), 0.0, 0.0, 0.0
    holes = np.flatnonzero(np.diff(time_s) > _hole_s(recording.time_s, config)) + 1
    for first, end in pairwise([0, *holes.tolist(), len(op)]):
        moved, turned = _turning(op[first:end], band)
        hours += float(time_s[end - 1] - time_s[first]) / 3600.0
        travel, reversals = travel + moved, reversals + turned
    return (travel / hours, reversals / hours) if hours > 0.0 else (None, None)


@njit(cache=True, nogil=True)
def _turning(op: FloatArray, band: float) -> tuple[float, int]:
    """Travel between turning points and their number; a turn counts once OP has come back by more than `band`."""
    travel, reversals, direction = 0.0, 0, 0
    anchor = low = high = op[0]
    for value in op:
        low, high = min(low, value), max(high, value)
        if direction <= 0 and value > low + band:
            travel, reversals = travel + anchor - low, reversals + (direction < 0)
            anchor, direction, high = low, 1, value
        elif direction >= 0 and value < high - band:
            travel, reversals = travel + high - anchor, reversals + (direction > 0)
            anchor, direction, low = high, -1, value
    return travel + (high - anchor if direction > 0 else anchor - low if direction < 0 else 0.0), reversals


def _hole_s(time_s: FloatArray, config: FitnessConfig) -> float:
    """What is longer between two samples of a record of times (N,), in s, is a hole."""
    return lasting(config.max_gap_intervals, time_s)


def _runs(controlled: IntArray, time_s: FloatArray, config: FitnessConfig) -> IntArray:
    """(n,) in which run of neighbours without a hole each of these samples of a record of times (N,) is."""
    if len(controlled) < 2:
        return np.zeros(len(controlled), dtype=np.int64)
    apart = (np.diff(controlled) > 1) | (np.diff(time_s[controlled]) > _hole_s(time_s, config))
    return np.concatenate(([0], np.cumsum(apart)))


def _harris_index(error: FloatArray, run: IntArray) -> float | None:
    """Residual variance of an autoregression that looks HARRIS_HORIZON samples back, over the mean square.

    error, run: (n,). What is foretold and what from are of one run: samples of two are not as far apart as they stand.
    """
    reach = HARRIS_HORIZON + HARRIS_TERMS - 1
    together = run[reach:] == run[: max(len(run) - reach, 0)]
    rows = int(np.count_nonzero(together))
    if rows < 5 * HARRIS_TERMS or np.ptp(error) <= resolution(error):
        return None
    error = error - np.mean(error)
    past, future = np.array([error[k : k + len(together)] for k in range(HARRIS_TERMS)]), error[reach:]
    if rows < len(together):
        past, future = past[:, together], future[together]
    if not np.mean(future**2) > 0.0:
        return None  # so small that no square of it is left
    # Normal equations with a trace of ridge: exact enough for an index, and a twentieth of the cost of an SVD.
    gram = past @ past.T
    gram[np.diag_indices_from(gram)] += 1e-9 * gram[0, 0]
    residual = future - np.linalg.solve(gram, past @ future) @ past
    degrees = max(rows - HARRIS_TERMS, 1)
    return min(1.0, float(residual @ residual / degrees / np.mean(future**2)))
