"""Statistics over time: of values that hold each until the next one came, which need not be equally long."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from app.engine.fitness import FitnessConfig
from app.engine.fitness.resample import is_regular, typical_interval
from app.engine.recording import BoolArray, FloatArray

_AROUND = 5
"""Intervals by whose median one is told to be a hole: two holes close to each other are, a slower sampling is none."""


def holding_times(time_s: FloatArray, config: FitnessConfig | None = None) -> FloatArray | None:
    """(N,) in s for how long what was sampled at `time_s` (N,) holds; None where all do for equally long.

    It is the time to the next sample, but where that is a hole no more than what may be filled: so many intervals
    (`config.max_gap_intervals`) of those around it, or of the whole record, whichever are longer. The last
    sample holds for a usual interval. Stamps of a scan that is a little late hold equally long.
    """
    config = config or FitnessConfig()
    if len(time_s) < 3 or not np.isfinite(time_s[-1] - time_s[0]) or is_regular(time_s, config):
        return None
    usual, intervals = typical_interval(time_s), np.diff(time_s)
    longest = np.full(len(intervals), config.max_gap_intervals * usual)
    if np.any(intervals > longest):
        around = median_filter(intervals, _AROUND, mode="mirror")
        longest = np.maximum(longest, config.max_gap_intervals * around)
    return np.append(np.minimum(intervals, longest), usual)


@dataclass(frozen=True, eq=False)
class Timed:
    """Values (n,), each for as long as it holds: held_s (n,) in s, above 0; None where all hold equally long."""

    values: FloatArray
    held_s: FloatArray | None

    def __len__(self) -> int:
        return len(self.values)

    def of(self, function: np.ufunc) -> "Timed":
        """A function of each value, for as long."""
        return Timed(function(self.values), self.held_s)

    def share(self, where: BoolArray) -> float:
        """The share of the time, 0 to 1, that the values in `where` (n,), n at least 1, hold."""
        return _mean(where, self.held_s)

    def mean(self) -> float | None:
        """None where there is no value, as of all that follow."""
        return _mean(self.values, self.held_s) if len(self) else None

    def std(self) -> float | None:
        if self.held_s is None:
            return float(np.std(self.values)) if len(self) else None
        mean = self.mean()
        return None if mean is None else float(np.sqrt(_mean((self.values - mean) ** 2, self.held_s)))

    def percentiles(self, wanted: Sequence[float]) -> list[float | None]:
        """Those wanted, 0 to 100: as of the values repeated each for as long as it holds, in units of the shortest."""
        if not len(self):
            return [None] * len(wanted)
        if self.held_s is None:
            return [float(value) for value in np.percentile(self.values, wanted)]
        return [float(value) for value in _percentiles(self.values, self.held_s, np.array(wanted))]


def _percentiles(values: FloatArray, held_s: FloatArray, wanted: FloatArray) -> FloatArray:
    order = np.argsort(values)
    times = held_s[order] / held_s.min()
    beyond = np.cumsum(times)
    places = np.column_stack((beyond - times, beyond - 1.0)).ravel()
    return np.interp(wanted / 100.0 * (beyond[-1] - 1.0), places, np.repeat(values[order], 2))


def _mean(values: FloatArray | BoolArray, held_s: FloatArray | None) -> float:
    return float(np.mean(values)) if held_s is None else float(values @ held_s / held_s.sum())
