"""How evenly a loop's swing keeps time: what a clock drives does, a valve that sticks lets go sooner or later."""

from dataclasses import dataclass

import numpy as np

from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.sampled import hann, without_line

FEWEST_CYCLES = 8
SMOOTHED_CYCLES = 2.0
HARMONICS = 8
WALK_LEFT_BY_LINE = 15.0
"""Of a walk of N steps a straight line leaves the N-th part of this in variance, in steps."""


@dataclass(frozen=True)
class Timekeeping:
    """jitter: standard deviation of the length of a cycle, as a share of it. unlike: what differs from cycle to cycle,
    as a share of the swing's standard deviation. Of PV and OP the greater one each.
    """

    jitter: float
    unlike: float


def timekeeping(record: UniformRecord, oscillation: Oscillation) -> Timekeeping | None:
    """How evenly PV and OP swing; None where there are fewer than FEWEST_CYCLES.

    A limit cycle finds its time anew in each cycle, so that its phase walks at random, the farther the more the cycles
    differ; what a timer drives comes back to its time. The phase of the fundamental is taken once a cycle, and what it
    leaves of a straight line is read as such a walk. What no sum of HARMONICS of the period explains is what differs.
    Noise, and a load that moves the mean, add to the jitter: a small one says that something keeps time, a large one
    says nothing. Misleads where a strong sine from outside holds a limit cycle to its own time, and in a loop without
    any noise. Source: Demir, Mehrotra, Roychowdhury 2000, Phase noise in oscillators, doi 10.1109/81.847872 (the phase
    of a free oscillator under noise is a random walk).
    """
    per_cycle = oscillation.samples_per_cycle
    if per_cycle is None or record.samples < (FEWEST_CYCLES + SMOOTHED_CYCLES) * per_cycle:
        return None
    pv, op = (_of_signal(without_line(x), per_cycle) for x in (record.pv, record.op))
    if pv is None or op is None:
        return None
    return Timekeeping(max(pv.jitter, op.jitter), max(pv.unlike, op.unlike))


def _of_signal(x: FloatArray, per_cycle: float) -> Timekeeping | None:
    """x: (N,) without its straight line. None where it has no fundamental."""
    weights = hann(round(SMOOTHED_CYCLES * per_cycle) + 2)[1:-1]
    turned = x * np.exp(-2j * np.pi * np.arange(len(x)) / per_cycle)
    starts = np.arange(0, len(x) - len(weights) + 1, per_cycle).astype(np.int64)
    fundamental = np.lib.stride_tricks.sliding_window_view(turned, len(weights))[starts] @ weights
    amplitude = np.abs(fundamental)
    if not np.all(amplitude > 0.0):
        return None
    phase = np.unwrap(np.angle(fundamental)) / (2.0 * np.pi)
    at = np.arange(len(phase), dtype=np.float64)
    slope, start = np.polyfit(at, phase, 1, w=amplitude)
    variance = float(np.average((phase - slope * at - start) ** 2, weights=amplitude**2))
    unlike = float(np.std(x - _periodic(x, (1.0 + slope) / per_cycle)) / np.std(x))
    return Timekeeping(float(np.sqrt(WALK_LEFT_BY_LINE * variance / len(phase))), unlike)


def _periodic(x: FloatArray, frequency: float) -> FloatArray:
    """(N,) the sum of HARMONICS of a frequency, in cycles a sample, nearest to x (N,)."""
    turns = 2.0 * np.pi * frequency * np.outer(np.arange(len(x)), np.arange(1, HARMONICS + 1))
    basis = np.concatenate((np.cos(turns), np.sin(turns)), axis=1)
    return np.asarray(basis @ np.linalg.lstsq(basis, x, rcond=None)[0])
