"""From the samples of a stretch to a uniform time base."""

from dataclasses import dataclass

import numpy as np

from app.engine.fitness.config import FitnessConfig
from app.engine.recording import BoolArray, FloatArray, UniformRecord
from app.engine.signals.sampled import held

# Of an interval: by so much a grid may miss the stamp that it was laid on, and a hole what is just filled.
_ROUNDING = 1e-6
# By so much its last point may lie beyond the last stamp: what rounding makes of one interval adds up over all.
_BEYOND = 1e-3

MOST_POINTS = 16
"""Times as many points as samples that a grid has: most of a finer one would be filled, however much may be."""


def typical_interval(time_s: FloatArray) -> float:
    """The median sampling interval of `time_s` (N,), N > 1, in seconds."""
    return _typical(np.diff(time_s))


def lasting(intervals: float, time_s: FloatArray) -> float:
    """The longest time in s that so many sampling intervals of `time_s` (N,), N > 1, take, whatever their unit rounded
    them to."""
    return intervals * typical_interval(time_s) * (1.0 + _ROUNDING)


def _typical(intervals: FloatArray) -> float:
    """The median; where all are alike it needs no order."""
    least = float(np.min(intervals))
    return least if least == np.max(intervals) else float(np.median(intervals))


def most_filled(samples: int, config: FitnessConfig) -> float:
    """How many sampling intervals a hole in a record of so many samples may last to be filled: a longer one splits it.

    Of a long record more than of a short one: a straight line over a few cycles of many says less than half of the
    record being left out.
    """
    return max(config.max_gap_intervals, min(config.most_gap_intervals, config.max_gap_share * samples))


def is_regular(time_s: FloatArray, config: FitnessConfig) -> bool:
    """Whether the stamps `time_s` (N,), N > 1, in s, are those of an even scan, one a tick: no interval strays from the
    median by more than `config.jitter_tolerance`, or no stamp from an even clock by more than `config.off_clock`.

    Stamps of a scan that is a little late, or that were rounded to seconds, are better taken as regular: interpolation
    would smooth the signals.
    """
    intervals = np.diff(time_s)
    interval = _typical(intervals)
    if np.all(np.abs(intervals - interval) <= config.jitter_tolerance * interval):
        return True
    clock = even_clock(time_s)
    if np.max(intervals) > (1.0 + 2.0 * config.off_clock) * clock.interval_s:  # a sample is missing
        return False
    return bool(np.max(np.abs(time_s - clock.ticks(len(time_s)))) <= config.off_clock * clock.interval_s)


def to_uniform(
    time_s: FloatArray, pv: FloatArray, op: FloatArray, sp: FloatArray | None, origin_s: float, config: FitnessConfig
) -> UniformRecord:
    """The stretch on a uniform time base: as it is where its sampling is regular, else PV and OP interpolated linearly
    and SP held, for it steps.

    time_s, pv, op, sp: (N,), N > 1; pv and op finite; sp may miss values. origin_s: the recording's first time in s.
    The interval is the mean of a regular stretch, which late scans do not bias. Of an irregular one it is the median,
    or, where that would fill more than `config.max_filled_share`, the mean or twice the mean, if one of them would not:
    a signal that was stored at random times holds no more than that. A sample is `filled` where the nearest measured
    one is more than half an interval away.
    """
    sp = _complete(time_s, sp)
    start_s = float(time_s[0] - origin_s)
    if is_regular(time_s, config):
        interval = _mean_interval(time_s)
        return UniformRecord(interval, pv.copy(), op.copy(), sp, np.zeros(len(time_s), dtype=bool), start_s)
    grid = _grid(time_s, config)
    return UniformRecord(
        grid.interval_s,
        np.interp(grid.time_s, time_s, pv),
        np.interp(grid.time_s, time_s, op),
        None if sp is None else held(time_s, sp, grid.time_s + _ROUNDING * grid.interval_s),
        grid.filled,
        start_s,
    )


@dataclass(frozen=True)
class Clock:
    """Even ticks in s: the first one, and the interval between two."""

    first_s: float
    interval_s: float

    def ticks(self, count: int) -> FloatArray:
        """The first `count` of them, (count,)."""
        ticks: FloatArray = self.first_s + self.interval_s * np.arange(count, dtype=np.float64)
        return ticks


def even_clock(time_s: FloatArray) -> Clock:
    """The clock that strays least, by squares, from the stamps `time_s` (N,), N > 1, one a tick."""
    from_middle = np.arange(len(time_s)) - 0.5 * (len(time_s) - 1)
    since_s = time_s - time_s[0]
    interval = float(from_middle @ since_s) / float(from_middle @ from_middle)
    return Clock(float(time_s[0] + since_s.mean() + interval * from_middle[0]), interval)


@dataclass(frozen=True, eq=False)
class _Grid:
    """Uniform times (K,) in s, and which of them are far from any measured sample."""

    interval_s: float
    time_s: FloatArray
    filled: BoolArray


def _grid(time_s: FloatArray, config: FitnessConfig) -> _Grid:
    mean = _mean_interval(time_s)
    most = MOST_POINTS * len(time_s)
    grids = [
        _grid_of(time_s, interval)
        for interval in (typical_interval(time_s), mean, 2.0 * mean)
        if _points(time_s, interval) <= most
    ]
    good = [
        grid
        for grid in grids
        if np.mean(grid.filled) <= config.max_filled_share and len(grid.time_s) >= config.min_samples
    ]
    return (good or grids)[0]


def _points(time_s: FloatArray, interval_s: float) -> int:
    return int(np.floor((time_s[-1] - time_s[0]) / interval_s + _BEYOND)) + 1


def _grid_of(time_s: FloatArray, interval_s: float) -> _Grid:
    count = _points(time_s, interval_s)
    times = time_s[0] + interval_s * np.arange(count)
    return _Grid(interval_s, times, _far_from_measured(times, time_s, 0.5 * interval_s))


def _mean_interval(time_s: FloatArray) -> float:
    return float((time_s[-1] - time_s[0]) / (len(time_s) - 1))


def _complete(time_s: FloatArray, sp: FloatArray | None) -> FloatArray | None:
    if sp is None:
        return None
    known = np.isfinite(sp)
    if not known.any():
        return None
    return sp.copy() if known.all() else held(time_s[known], sp[known], time_s)


def _far_from_measured(grid: FloatArray, time_s: FloatArray, limit_s: float) -> BoolArray:
    after = np.clip(np.searchsorted(time_s, grid), 1, len(time_s) - 1)
    nearest = np.minimum(np.abs(time_s[after] - grid), np.abs(grid - time_s[after - 1]))
    return nearest > limit_s * (1.0 + 1e-9)
