"""The windows on which shapes are looked at: some fifteen periods, brought to forty samples a period."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import deviation, moving_average, resample, slope, without_drift, without_line

PER_CYCLE = 40
CYCLES = 15
MOST_WINDOWS = 3
"""Windows of a record that are looked at, at most: what judges a loop was trained on so many."""
_DRIFT_HALF = 60
_SMOOTHING_HALF = 2
_FEWEST_SAMPLES = 64
_SLOW_CYCLES = 8.0
# Below these shares of their variance, PV and OP live on a slower scale than the oscillation that was found.
_OP_SHARE, _PV_SHARE = 0.12, 0.3


@dataclass(frozen=True, eq=False)
class ShapeWindow:
    """One window of a loop, ready for the shape features: free of unit, offset and slow drift.

    pv, op: (n,) at PER_CYCLE samples a cycle, without drift, at unit standard deviation.
    pv_smooth, op_smooth: (n,) the same, smoothed over about an eighth of a cycle.
    pv_slope, op_slope: (n,) the slopes of these, a sample.
    raw_pv, raw_op: (m,) as recorded. even_pv, even_op: (n,) at PER_CYCLE samples a cycle, with their drift.
    """

    pv: FloatArray
    op: FloatArray
    pv_smooth: FloatArray
    op_smooth: FloatArray
    pv_slope: FloatArray
    op_slope: FloatArray
    raw_pv: FloatArray
    raw_op: FloatArray
    even_pv: FloatArray
    even_op: FloatArray


def shape_windows(record: UniformRecord, oscillation: Oscillation, most: int = MOST_WINDOWS) -> list[ShapeWindow]:
    """Up to `most` windows spread over the record, none where PV or OP does not vary.

    Where hardly any of the variance of OP and PV is in the oscillation (a ripple on a slow ramp), the scale is an
    eighth of the record instead of the period.
    """
    per_cycle = cycle_samples(record, oscillation)
    windows = (window_of(record.pv[part], record.op[part], per_cycle) for part in spans(record, per_cycle, most))
    return [window for window in windows if window is not None]


def spans(record: UniformRecord, per_cycle: float, most: int) -> list[slice]:
    """The samples of each window: up to `most`, some fifteen cycles of `per_cycle` samples each."""
    length = int(min(record.samples, max(CYCLES * per_cycle, _FEWEST_SAMPLES)))
    count = min(max(record.samples // length, 2 if record.samples > 1.3 * length else 1), most)
    last = record.samples - length
    starts = [*(int(k * (last / (count - 1))) for k in range(count - 1)), last] if count > 1 else [0]
    return [slice(start, start + length) for start in starts]


def cycle_samples(record: UniformRecord, oscillation: Oscillation) -> float:
    """Samples in one cycle of the scale on which the loop is looked at."""
    per_cycle = oscillation.samples_per_cycle or record.samples / 4
    if record.samples < 2 * CYCLES * per_cycle:
        return per_cycle
    half = int(1.5 * per_cycle)
    if _fast_share(record.op, half) < _OP_SHARE and _fast_share(record.pv, half) < _PV_SHARE:
        return record.samples / _SLOW_CYCLES
    return per_cycle


def _fast_share(x: FloatArray, half: int) -> float:
    """Share of the variance of x (N,), less its straight line, that is not in its moving average."""
    x = without_line(x)
    total = float(deviation(x)) ** 2
    return float(deviation(x - moving_average(x, half))) ** 2 / total if total > 0.0 else 1.0


def window_of(raw_pv: FloatArray, raw_op: FloatArray, per_cycle: float) -> ShapeWindow | None:
    """raw_pv, raw_op: (m,) as recorded, per_cycle samples a cycle. None where PV or OP does not vary."""
    even_pv, even_op = resample(raw_pv, per_cycle, PER_CYCLE), resample(raw_op, per_cycle, PER_CYCLE)
    pv, op = _swings(even_pv), _swings(even_op)
    if len(pv) == 0 or len(op) == 0:
        return None
    return ShapeWindow(pv[0], op[0], pv[1], op[1], pv[2], op[2], raw_pv, raw_op, even_pv, even_op)


@njit(cache=True, nogil=True)
def _swings(x: FloatArray) -> FloatArray:
    """(3, n): x (n,) without drift at unit deviation, the same smoothed, and the slope of that; none where x does not
    vary. In one kernel, as the features of a window are: to hand its array over costs more than most of them.
    """
    swing = without_drift(x, _DRIFT_HALF)
    spread, largest = deviation(swing), 0.0
    for value in x:
        largest = max(largest, abs(value))
    # What remains of a constant is rounding, not a signal.
    if spread <= 1e-9 * largest:
        return np.empty((0, len(x)))
    swings = np.empty((3, len(x)))
    swings[0] = swing / spread
    swings[1] = moving_average(moving_average(swings[0], _SMOOTHING_HALF), _SMOOTHING_HALF)
    swings[2] = slope(swings[1])
    return swings
