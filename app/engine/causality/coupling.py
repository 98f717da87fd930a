"""Whether PV and OP have anything to do with each other, whatever swings and wanders in each."""

import numpy as np
from scipy.special import chdtrc

from app.engine.features import PER_CYCLE
from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.innovations import SAMPLES_A_LAG, apart, innovations
from app.engine.signals.sampled import block_means

ORDER = 20
LAGS = 20
FEWEST_CYCLES = 8
FINER = 8
SHIFTS = 12


def strangers_chance(record: UniformRecord, oscillation: Oscillation) -> float | None:
    """Probability that PV and OP which have nothing to do with each other are as alike as these, 0 to 1.

    Two signals that swing, or wander, look alike by chance. So each is first foretold from its own past, and only what
    is new in one is compared with what is new in the other, up to LAGS samples before and after: half a cycle
    where that has forty. None where the record is too short to tell; 1 where one of the two foretells itself
    altogether. Source: Haugh 1976, Checking the independence of two covariance-stationary time series,
    doi 10.1080/01621459.1976.10480353.
    """
    stride = _stride(record, oscillation)
    return None if record.samples // stride < SAMPLES_A_LAG * ORDER else _chance(record, stride)


def strangers_chance_finely(record: UniformRecord, oscillation: Oscillation) -> float:
    """The same FINER times as finely, and so on down to the samples: the least of these chances, times their number.

    The slowest swing of a long record is its load's, and between two points of that a quick loop is done with it. Taken
    so finely a limit cycle is not all foretold: where OP is as like PV at other times, as strangers that swing are, it
    counts for chance.
    """
    strides = [_stride(record, oscillation)]
    while strides[-1] > 1:
        strides.append(max(1, strides[-1] // FINER))
    chances = [_chance(record, stride, beside_shifts=True) for stride in strides[1:]]
    return min(1.0, len(chances) * min(chances)) if chances else 1.0


def _stride(record: UniformRecord, oscillation: Oscillation) -> int:
    per_cycle = min(oscillation.samples_per_cycle or PER_CYCLE, record.samples / FEWEST_CYCLES)
    return max(1, int(per_cycle / PER_CYCLE))


def _chance(record: UniformRecord, stride: int, *, beside_shifts: bool = False) -> float:
    """That of every so many samples; 1 where OP is half as like PV in one of SHIFTS places elsewhere in the record."""
    pv, op = (innovations(block_means(x, stride)[None], ORDER) for x in (record.pv, record.op))
    if pv is None or op is None:
        return 1.0
    pv, op = pv[0], op[0]
    alike = _alike(pv, op)
    if beside_shifts:
        elsewhere = (_alike(pv, np.roll(op, k * len(op) // (SHIFTS + 1))) for k in range(1, SHIFTS + 1))
        if max(elsewhere) > alike / 2.0:
            return 1.0
    return float(chdtrc(2 * LAGS + 1, alike))


def _alike(pv: FloatArray, op: FloatArray) -> float:
    """Haugh's statistic of two innovations (n,)."""
    shifted = (apart(pv, op, lag) for lag in range(-LAGS, LAGS + 1))
    return float(len(pv) * np.sum(np.square([later @ earlier for later, earlier in shifted])))
