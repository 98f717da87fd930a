"""Key figures that engineers expect of a loop monitor, over good samples only: each with its definition and source."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.fitness.signals import at_extremes, at_limits, quantisation_step, resolution, usable_values
from app.engine.oscillation import autocorrelation
from app.engine.recording import BoolArray, FloatArray, Recording, Span, known_span
from app.errors import DataError

FEWEST_STEPS = 10
"""Steps of its resolution below which OP's own extremes say nothing of limits."""

REVERSAL_SHARE = 0.02
"""A reversal counts once OP has come back by this share of its range (5th to 95th percentile): noise is no travel."""

SHORTEST_FOR_RESPONSE = 100
"""Samples below which the autocorrelation says little about how long an upset is felt."""

HARRIS_TERMS = 20
"""Autoregressive terms of the minimum-variance benchmark; Desborough and Harris 1992 use 5 to 30."""


@dataclass(frozen=True)
class KeyFigures:
    """Plain figures of a loop over the good samples of a record; None where a figure cannot be had, never 0 instead.

    good_share_pct: samples with PV and OP, of all samples.
    service_factor_pct: good samples in automatic, of all good samples; None where the mode was not recorded.
    op_saturation_pct: automatic samples with OP within 0.5 % of an end of its span; None without a known span.
    op_at_extreme_pct: automatic samples with OP at the one of its own extremes where it stands longer; None where its
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
    harris_index: minimum over present variance of the control error, 0 (poor) to 1 (no better control possible).
    harris_horizon_samples: the dead time, in samples, that the index assumes.
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


def compute(recording: Recording, harris_horizon_samples: int = 5) -> KeyFigures:
    """The key figures of one recording.

    recording: PV, OP and SP in engineering units, NaN where missing.
    harris_horizon_samples: assumed dead time in samples, at least 1.
    Raises DataError("harris_horizon") below 1.

    Only samples with finite PV and OP count; control error, saturation and Harris index use those in automatic where
    the mode is known. The Harris index depends on the assumed dead time and punishes loops that follow a moving set
    point or that are meant to let a level swing: compare a loop with itself.
    Sources: Jelali 2013, Control Performance Management in Industrial Automation, doi 10.1007/978-1-4471-4546-2
    (figures); Harris 1989, Can. J. Chem. Eng. 67, 856, doi 10.1002/cjce.5450670519, and Desborough and Harris 1992,
    doi 10.1002/cjce.5450700620 (index).
    """
    if harris_horizon_samples < 1:
        got = f"the Harris index needs a horizon of 1 sample or more, got {harris_horizon_samples}"
        raise DataError("harris_horizon", got)
    good = usable_values(recording.pv) & usable_values(recording.op)
    used = good if recording.automatic is None else good & recording.automatic
    error = None if recording.sp is None else (recording.sp - recording.pv)[used & usable_values(recording.sp)]
    controlled = recording.pv[used] if error is None or len(error) == 0 else error
    travel = _travel(recording, good)
    pv, op = recording.pv[good], recording.op[good]
    size = None if error is None else np.abs(error)
    low, median, high = _percentiles(error, (5.0, 50.0, 95.0))
    return KeyFigures(
        good_share_pct=100.0 * float(good.mean()) if recording.samples else 0.0,
        service_factor_pct=_share_pct(used, good) if recording.automatic is not None else None,
        op_saturation_pct=_saturation_pct(recording.op[used], recording.op_range),
        op_at_extreme_pct=_at_extreme_pct(recording.op[used]) if known_span(recording.op_range) is None else None,
        error_mean=_statistic(error, np.mean),
        error_std=_statistic(error, np.std),
        error_abs_mean=_statistic(size, np.mean),
        error_abs_p95=_percentiles(size, (95.0,))[0],
        error_p05=low,
        error_median=median,
        error_p95=high,
        error_abs_mean_pct_of_span=_pct_of_span(_statistic(size, np.mean), recording.pv_range),
        variability_pct=_variability_pct(pv),
        pv_std=_statistic(pv, np.std),
        op_std=_statistic(op, np.std),
        op_travel_per_h=None if travel is None else travel[0],
        op_reversals_per_h=None if travel is None else travel[1],
        op_travel_pct_of_span_per_h=_pct_of_span(None if travel is None else travel[0], recording.op_range),
        response_time_s=_response_time_s(controlled, recording.time_s),
        harris_index=_harris_index(controlled, harris_horizon_samples),
        harris_horizon_samples=harris_horizon_samples,
    )


def _share_pct(part: BoolArray, whole: BoolArray) -> float | None:
    return 100.0 * float(part.sum() / whole.sum()) if whole.any() else None


def _statistic(values: FloatArray | None, function: Callable[[FloatArray], float]) -> float | None:
    return None if values is None or len(values) == 0 else float(function(values))


def _percentiles(values: FloatArray | None, wanted: tuple[float, ...]) -> list[float | None]:
    if values is None or len(values) == 0:
        return [None] * len(wanted)
    return [float(value) for value in np.percentile(values, wanted)]


def _pct_of_span(value: float | None, span: Span | None) -> float | None:
    known = known_span(span)
    return None if value is None or known is None else 100.0 * value / (known[1] - known[0])


def _response_time_s(error: FloatArray, time_s: FloatArray) -> float | None:
    """How long an upset is felt: where the autocorrelation of the error (N,) first falls below 1/e.

    Gaps are closed up, so that a record with long gaps gives a value that is too short.
    """
    if len(error) < SHORTEST_FOR_RESPONSE or np.ptp(error) <= resolution(error):
        return None
    below = np.flatnonzero(autocorrelation(error) < np.exp(-1.0))
    # At no lag at all it is 1, or 0 where the square of the error is too small a number.
    return None if len(below) == 0 or below[0] == 0 else float(below[0] * np.median(np.diff(time_s)))


def _saturation_pct(op: FloatArray, op_range: Span | None) -> float | None:
    at_limit = at_limits(op, op_range)
    return None if at_limit is None or not len(op) else 100.0 * float(np.mean(at_limit[0] | at_limit[1]))


def _at_extreme_pct(op: FloatArray) -> float | None:
    step = quantisation_step(op) if len(op) else None
    # A signal of a few values is at its least or greatest for much of the time whatever it does.
    return None if step is None or np.ptp(op) < FEWEST_STEPS * step else 100.0 * max(float(np.mean(there)) for there in at_extremes(op))


def _variability_pct(pv: FloatArray) -> float | None:
    if len(pv) == 0:
        return None
    mean, std = float(np.mean(pv)), float(np.std(pv))
    # About a mean near zero (deviation variables, temperatures around 0) the ratio says nothing.
    return 200.0 * std / abs(mean) if abs(mean) > std else None


def _travel(recording: Recording, good: BoolArray) -> tuple[float, float] | None:
    """(travel, reversals) an hour, or None for fewer than two good samples."""
    if good.sum() < 2:
        return None
    time_s, op = recording.time_s[good], recording.op[good]
    low, high = np.percentile(op, [5.0, 95.0])
    travel, reversals = _turning(np.ascontiguousarray(op), REVERSAL_SHARE * float(high - low))
    hours = float(time_s[-1] - time_s[0]) / 3600.0
    return travel / hours, reversals / hours


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


def _harris_index(error: FloatArray, horizon: int) -> float | None:
    """Residual variance of an autoregression that looks `horizon` samples back, over the mean square."""
    rows = len(error) - horizon - HARRIS_TERMS + 1
    if rows < 5 * HARRIS_TERMS or np.ptp(error) <= resolution(error):
        return None
    error = error - np.mean(error)
    if not np.mean(error[horizon + HARRIS_TERMS - 1 :] ** 2) > 0.0:
        return None  # so small that no square of it is left
    past = np.lib.stride_tricks.sliding_window_view(error, HARRIS_TERMS)[:rows]
    future = error[horizon + HARRIS_TERMS - 1 :]
    # Normal equations with a trace of ridge: exact enough for an index, and a twentieth of the cost of an SVD.
    gram = past.T @ past
    gram[np.diag_indices_from(gram)] += 1e-9 * gram[0, 0]
    residual = future - past @ np.linalg.solve(gram, past.T @ future)
    degrees = max(rows - HARRIS_TERMS, 1)
    return min(1.0, float(residual @ residual / degrees / np.mean(future**2)))
