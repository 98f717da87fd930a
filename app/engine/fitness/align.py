"""PV and OP that were stamped at different times, brought to the times of one of them."""

from dataclasses import dataclass

import numpy as np

from app.engine.fitness.config import FitnessConfig
from app.engine.fitness.resample import lasting
from app.engine.fitness.signals import usable_values, wild
from app.engine.recording import BoolArray, FloatArray, Recording

# Below this share of the sparser signal's samples with a partner, the two were not sampled together.
PARTNERED_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Aligned:
    """pv, op: (N,) as recorded, or interpolated at the other's times. both: (N,) True where both have a value.

    interpolated: the signal that was interpolated, "PV" or "OP", or None where they were sampled together.
    wild_pv, wild_op: the values, in order of time, that were recorded and lie so far off that they count as missing.
    """

    pv: FloatArray
    op: FloatArray
    both: BoolArray
    interpolated: str | None
    wild_pv: FloatArray
    wild_op: FloatArray


def align(recording: Recording, config: FitnessConfig) -> Aligned:
    """PV and OP with a value at the same times.

    Signals that a historian stamps one by one never meet in a row: where fewer than half of the sparser signal's
    samples have a partner, the denser is interpolated linearly at the times of the sparser, but not across its holes.
    """
    has_pv, wild_pv = _tame(recording.pv, recording.time_s, config)
    has_op, wild_op = _tame(recording.op, recording.time_s, config)
    both = has_pv & has_op
    n_pv, n_op = int(np.sum(has_pv)), int(np.sum(has_op))
    if min(n_pv, n_op) < 2 or np.sum(both) >= PARTNERED_SHARE * min(n_pv, n_op):
        return Aligned(recording.pv, recording.op, both, None, wild_pv, wild_op)
    if n_op <= n_pv:
        reached = has_op & _reachable(recording.time_s, has_pv, config)
        pv = _interpolated(recording.time_s, recording.pv, has_pv)
        return Aligned(pv, recording.op, reached, "PV", wild_pv, wild_op)
    reached = has_pv & _reachable(recording.time_s, has_op, config)
    op = _interpolated(recording.time_s, recording.op, has_op)
    return Aligned(recording.pv, op, reached, "OP", wild_pv, wild_op)


def _tame(signal: FloatArray, time_s: FloatArray, config: FitnessConfig) -> tuple[BoolArray, FloatArray]:
    """(N,) True where `signal` (N,) at `time_s` (N,) has a value to go by; and those of its values that are wild."""
    usable = usable_values(signal) & usable_values(time_s)
    known = np.flatnonzero(usable)
    far = known[wild(signal[known], time_s[known], config)]
    usable[far] = False
    return usable, signal[far]


def _interpolated(time_s: FloatArray, signal: FloatArray, known: BoolArray) -> FloatArray:
    return np.where(known, signal, np.interp(time_s, time_s[known], signal[known]))


def _reachable(time_s: FloatArray, known: BoolArray, config: FitnessConfig) -> BoolArray:
    """(N,) True between two known samples that are no further apart than a hole that may be filled."""
    stamps = time_s[known]
    after = np.searchsorted(stamps, time_s)
    inside = (after > 0) & (after < len(stamps))
    after = np.clip(after, 1, len(stamps) - 1)
    narrow = stamps[after] - stamps[after - 1] <= lasting(config.max_gap_intervals, stamps)
    return known | (inside & narrow)
