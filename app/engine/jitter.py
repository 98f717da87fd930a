"""How evenly a loop's swing keeps time: what a clock drives does, a valve that sticks lets go sooner or later."""

import numpy as np

from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.sampled import hann, without_line

FEWEST_CYCLES = 8
SMOOTHED_CYCLES = 2.0
WALK_LEFT_BY_LINE = 15.0
"""Of a walk of N steps a straight line leaves the N-th part of this in variance, in steps."""


def period_jitter(record: UniformRecord, oscillation: Oscillation) -> float | None:
    """Standard deviation of the length of a cycle as a share of it, the greater one of PV's and OP's; None where there
    are fewer than FEWEST_CYCLES.

    A limit cycle finds its time anew in each cycle, so that its phase walks at random; what a timer drives comes back
    to its time. The phase of the fundamental is taken once a cycle, and what it leaves of a straight line is read as
    such a walk. Noise, and a load that moves the mean, add to it: a small value says that something keeps time, a large
    one says nothing. Source: Demir, Mehrotra, Roychowdhury 2000, Phase noise in oscillators,
    doi 10.1109/81.847872 (the phase of a free oscillator under noise is a random walk).
    """
    per_cycle = oscillation.samples_per_cycle
    if per_cycle is None or record.samples < (FEWEST_CYCLES + SMOOTHED_CYCLES) * per_cycle:
        return None
    phases = [_phase(x, per_cycle) for x in (record.pv, record.op)]
    found = [_walk(*phase) for phase in phases if phase is not None]
    return max(found) if len(found) == len(phases) else None


def _phase(x: FloatArray, per_cycle: float) -> tuple[FloatArray, FloatArray] | None:
    """Phase (n,), in cycles, and amplitude (n,) of the fundamental, once a cycle; None where there is none."""
    turned = without_line(x) * np.exp(-2j * np.pi * np.arange(len(x)) / per_cycle)
    weights = hann(round(SMOOTHED_CYCLES * per_cycle) + 2)[1:-1]
    starts = np.arange(0, len(x) - len(weights) + 1, per_cycle).astype(np.int64)
    fundamental = np.lib.stride_tricks.sliding_window_view(turned, len(weights))[starts] @ weights
    if not np.all(np.abs(fundamental) > 0.0):
        return None
    return np.unwrap(np.angle(fundamental)) / (2.0 * np.pi), np.abs(fundamental)


def _walk(phase: FloatArray, amplitude: FloatArray) -> float:
    """Root mean square of the steps of a random walk that leaves as much of a straight line as these phases (n,)."""
    at = np.arange(len(phase), dtype=np.float64)
    left = phase - np.polyval(np.polyfit(at, phase, 1, w=amplitude), at)
    variance = float(np.average(left**2, weights=amplitude**2))
    return float(np.sqrt(WALK_LEFT_BY_LINE * variance / len(phase)))
