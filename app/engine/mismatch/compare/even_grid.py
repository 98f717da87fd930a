"""Signals as they were sampled, on a grid of equal intervals: what is compared, and which of its points are no
invention.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.counting import counted, counted_times
from app.engine.evidence import Reason
from app.engine.fitness.resample import MOST_POINTS
from app.engine.mismatch.compare.aligning import beyond, covering
from app.engine.mismatch.compare.comparison import LEAST_SAMPLES, Comparison, LinearSimulation
from app.engine.recording import BoolArray, FloatArray, IntArray, Recording
from app.engine.signals.sampled import held
from app.errors import DataError

_GAP_INTERVALS = 3.0
_SAME_STAMP = 0.01  # of an interval: so near a stamp a grid point is the sample
_STAMP_ROUNDING = 1e-6  # of an interval: by so much a grid may miss the stamp that it was laid on
_SPARSE = 3.0
_HOLE_INTERVALS = 40.0  # as long as what an audit fills at most
_FEW_HOLES = 0.01


def comparison_of(
    recording: Recording, trace: FloatArray | None = None, simulation: LinearSimulation | None = None
) -> Comparison:
    """A recording against a simulated trace (N,) at its times, unit of PV; or against a model, or our own linear loop.

    Raises DataError("simulation_length") where the trace has another number of samples, and as `uniform` does.
    """
    signals = {"op": recording.op, "pv": recording.pv}
    signals |= {"sp": recording.sp} if recording.sp is not None else {}
    if trace is not None and len(trace) != recording.samples:
        raise DataError(
            "simulation_length", f"the simulation has {len(trace):,} samples, the recording {recording.samples:,}"
        )
    signals |= {"trace": trace} if trace is not None else {}
    found = uniform(recording.name, recording.time_s, signals, dict(recording.others))
    return found if trace is not None else replace(found, simulation=simulation)


def uniform(name: str, time: FloatArray, signals: dict[str, FloatArray], others: dict[str, FloatArray]) -> Comparison:
    """Equal sampling at the median interval; trailing rows without PV and OP are left out, gaps are bridged and
    marked: by straight lines, but the set point holds, for it steps.

    time: (N,) s, in any order. signals: (N,) each by name, "pv" and "op", and "sp" and "trace" (a simulated PV) where
    there are any; others: further ones, left out where they have no values; NaN where a value is missing. Raises
    DataError("too_short") below LEAST_SAMPLES samples with time, PV and OP, and "simulation_is_pv",
    "simulation_length" as `_refuse_a_copy` and `_whole_trace` do.
    """
    present = np.isfinite(time) & np.isfinite(signals["pv"]) & np.isfinite(signals["op"])
    if present.sum() < LEAST_SAMPLES:
        raise DataError(
            "too_short",
            f"{name} has {counted(int(present.sum()), 'sample')} with time, PV and OP, at least {LEAST_SAMPLES} are "
            "needed",
        )
    order = np.flatnonzero(present)[np.argsort(time[present], kind="stable")]
    kept = np.concatenate(([True], np.diff(time[order]) > 0.0))
    notes = faults_of_the_clock(time[present], int(np.sum(~kept)))
    order = order[kept]
    if "trace" in signals:
        _refuse_a_copy(signals["pv"][order], signals["trace"][order])
        notes += _whole_trace(time, order, signals["trace"])
    grid = _grid_over(time[order] - time[order[0]])
    on_grid = {each: _resampled(signal[order], grid, steps=each == "sp") for each, signal in signals.items()}
    further = ((each, _resampled(signal[order], grid)) for each, signal in others.items())
    sp = on_grid.get("sp")
    return Comparison(
        name=name,
        sampling_interval_s=grid.interval_s,
        op=on_grid["op"],
        pv=on_grid["pv"],
        sp=None if sp is None or not np.all(np.isfinite(sp)) else sp,
        measured=tuple((each, signal) for each, signal in further if np.all(np.isfinite(signal))),
        known=None if grid.even else _known_at(grid.points_s, grid.sampled_s, grid.interval_s),
        trace=on_grid.get("trace"),
        notes=notes,
    )


@dataclass(frozen=True, eq=False)
class _Grid:
    """Points (M,) an interval apart, in s from the first sample, and the times (N,) s at which samples came; even:
    whether those are the points.
    """

    interval_s: float
    points_s: FloatArray
    sampled_s: FloatArray
    even: bool


def _grid_over(at: FloatArray) -> _Grid:
    """The grid for samples at the times (N,) s, N > 1, increasing from 0, at the interval of `_interval_of`."""
    interval = _interval_of(at)
    points = np.arange(int(np.floor(at[-1] / interval + 1e-6)) + 1, dtype=np.float64) * interval
    even = len(points) == len(at) and bool(np.allclose(points, at, atol=_SAME_STAMP * interval))
    return _Grid(interval, points, at, even)


def _interval_of(at: FloatArray) -> float:
    """The median, or the mean where it is much longer: of samples that came on change, a grid as fine as their usual
    distance would be mostly invented. Nights with the days between them left out are no such samples.
    """
    steps = np.diff(at)
    usual, average = float(np.median(steps)), float(np.mean(steps))
    if average <= _SPARSE * usual:
        return usual
    within = steps[steps <= _HOLE_INTERVALS * usual]
    few = len(steps) - len(within) <= _FEW_HOLES * len(steps)
    few_points = at[-1] <= MOST_POINTS * len(at) * usual
    return usual if few and few_points and float(np.mean(within)) <= _SPARSE * usual else average


def _resampled(values: FloatArray, grid: _Grid, *, steps: bool = False) -> FloatArray:
    """Values (N,) at the grid's samples as (M,) at its points: on straight lines, or held where the signal steps; NaN
    throughout where fewer than two are known.
    """
    finite = np.isfinite(values)
    if grid.even and np.all(finite):
        return values
    if finite.sum() < 2:
        return np.full(len(grid.points_s), np.nan)
    known = grid.sampled_s[finite], values[finite]
    if steps:
        return held(*known, grid.points_s + _STAMP_ROUNDING * grid.interval_s)
    return np.interp(grid.points_s, *known)


def _known_at(grid: FloatArray, at: FloatArray, interval: float) -> BoolArray:
    """(M,) True where a point of the grid (M,) is no invention: between samples, at the times (N,), that are no gap
    apart, and on a sample at the end of a gap.
    """
    behind = np.clip(np.searchsorted(at, grid), 1, len(at) - 1)
    before, after = at[behind - 1], at[behind]
    recorded = np.minimum(np.abs(grid - before), np.abs(after - grid)) <= _SAME_STAMP * interval
    return recorded | (after - before < _GAP_INTERVALS * interval)


def _refuse_a_copy(pv: FloatArray, trace: FloatArray) -> None:
    """Raises DataError("simulation_is_pv") where a simulation (N,) is the recorded PV itself: no loop is simulated to
    the last digit of what was measured, and nothing would ever be missing.
    """
    if np.array_equal(pv, trace):
        text = "the simulation is PV itself, sample for sample: there is nothing to compare"
        raise DataError("simulation_is_pv", text)


def _whole_trace(time: FloatArray, order: IntArray, trace: FloatArray) -> tuple[Reason, ...]:
    """What is to be said of a simulation (N,) recorded at the times (N,) s, of which the samples `order` are compared.

    Raises DataError("simulation_length") where it does not cover them: as a line from its last value on it would be
    compared with what it has not simulated.
    """
    simulated = np.isfinite(time) & np.isfinite(trace)
    if simulated.sum() < 2:
        return ()  # refused as a simulation without values
    at = time[simulated]
    covering(time[order], np.sort(at))
    said = beyond(float(time[order[0]]), float(time[order[-1]]), at)
    within = order[(time[order] >= np.min(at)) & (time[order] <= np.max(at))]
    holes = int(np.sum(~np.isfinite(trace[within])))
    if not holes:
        return said
    text = (
        counted(
            holes, "sample of the simulation has no value and is", "samples of the simulation have no value and are"
        )
        + " bridged by straight lines"
    )
    return (*said, Reason("simulation_bridged", text))


def faults_of_the_clock(time: FloatArray, repeated: int) -> tuple[Reason, ...]:
    """What times (N,) s in the order of the file hide: an hour that comes twice is sorted into the one before."""
    found = []
    if back := int(np.sum(np.diff(time) < 0.0)):
        text = f"time runs back {counted_times(back)}; sorting by time mixes the samples around a clock that was reset"
        found.append(Reason("time_runs_back", text))
    if repeated:
        found.append(
            Reason(
                "times_repeated",
                counted(repeated, "sample with a repeated time is", "samples with a repeated time are") + " left out",
            )
        )
    return tuple(found)
