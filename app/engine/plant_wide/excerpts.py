"""What is kept of a loop's OP and SP so that it can be told, without samples, that one loop's OP is another's SP."""

from dataclasses import dataclass

import numpy as np

from app.engine.recording import FloatArray, IntArray, Recording, Steps
from app.engine.signals.sampled import ROUNDING, held

LENGTH = 64
MOST = 6

INTERVALS_S = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1800.0, 3600.0)
"""What excerpts are sampled at: the same instants in all loops of about one sampling."""

ABOUT = 1.1
"""By how much longer than a usual interval a sampling still counts as that one."""


@dataclass(frozen=True, eq=False)
class Excerpts:
    """LENGTH values of OP and SP each at some times that are the same for all loops of one interval.

    interval_s: between two values, in s. numbers: (B,) increasing; excerpt k begins at k LENGTH interval_s on a clock
    that the compared loops share.
    op, sp: (B, LENGTH) in the unit of the signal, or in steps of its range as they are kept; None where it stands or
    was not recorded.
    """

    interval_s: float
    numbers: IntArray
    op: FloatArray | Steps | None
    sp: FloatArray | Steps | None


def excerpts_of(recording: Recording, origin_s: float) -> Excerpts | None:
    """Excerpts spread over a recording whose second 0 is at `origin_s` on the shared clock, in s.

    A value holds until the next one, as historians store it. None where neither OP nor SP moves in them, and where
    the recording is shorter than one.
    """
    if recording.samples < LENGTH:
        return None
    interval_s = _interval_s(recording)
    numbers = _numbers(origin_s + recording.time_s[0], origin_s + recording.time_s[-1], interval_s)
    # Half an interval after the instant, so that stamps may be early or late.
    at_s = (numbers[:, None] * LENGTH + np.arange(LENGTH, dtype=np.float64) + 0.5) * interval_s - origin_s
    op, sp = (None if x is None else _held(recording.time_s, x, at_s) for x in (recording.op, recording.sp))
    return None if op is None and sp is None else Excerpts(interval_s, numbers, op, sp)


def _interval_s(recording: Recording) -> float:
    """The one of INTERVALS_S that is about as long as the usual one of the recording, or the next longer one."""
    usual = float(np.median(np.diff(recording.time_s)))
    return next((interval_s for interval_s in INTERVALS_S if interval_s >= usual / ABOUT), INTERVALS_S[-1])


def _numbers(start_s: float, end_s: float, interval_s: float) -> IntArray:
    """Of the excerpts within a record MOST at most, at every so many: a power of two, so that those of a longer record
    are among those of a shorter one.
    """
    length_s = LENGTH * interval_s
    first, beyond = int(np.ceil(start_s / length_s)), int(np.floor((end_s + interval_s) / length_s))
    every = 1
    while (beyond - first) / every > MOST:
        every *= 2
    return np.arange(-(-first // every) * every, beyond, every, dtype=np.int64)


def _held(time_s: FloatArray, signal: FloatArray, at_s: FloatArray) -> FloatArray | None:
    """(B, LENGTH) the last known value at each of these times; None where they are all one."""
    known = np.isfinite(signal)
    if not known.any() or not at_s.size:
        return None
    values = held(time_s[known], signal[known], at_s)
    return values if np.ptp(values) > ROUNDING * float(np.max(np.abs(values))) else None
