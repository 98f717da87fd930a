"""How evenly a loop's swing keeps time. What a clock drives keeps it; a valve that sticks lets go sooner or later."""

import math
from dataclasses import dataclass

import numpy as np

from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import hann, without_line

FEWEST_CYCLES = 8
SMOOTHED_CYCLES = 2.0
MOST_KNOTS = 100
RIDGE = 1e-12
"""Of the samples of all cycles, as if so many lay at each knot."""

WALK_LEFT_BY_LINE = 15.0
"""Of a walk of N steps a straight line leaves the N-th part of this in variance, in steps."""


@dataclass(frozen=True)
class Timekeeping:
    """jitter: standard deviation of the cycle length, as a share of it. unlike: what differs from cycle to cycle, as a
    share of the swing's standard deviation. Each is the larger one of PV and OP.
    """

    jitter: float
    unlike: float


def timekeeping(record: UniformRecord, oscillation: Oscillation, uneven: float = math.inf) -> Timekeeping | None:
    """How evenly PV and OP swing; None if there are fewer than FEWEST_CYCLES. uneven: a jitter that is large enough to
    stop at; if PV has it, that of OP is not computed.

    A limit cycle finds its time anew in each cycle, so its phase walks at random, and the farther the more the cycles
    differ. What a timer drives comes back to its time. The phase of the fundamental is taken once a cycle, and its
    residual from a straight line is read as such a walk. What differs is what the mean cycle does not explain.
    Noise, and a load that moves the mean, add to the jitter: a small jitter shows that something keeps time, a large
    one shows nothing. Misleads if a strong sine from outside holds a limit cycle to its own time, and in a loop without
    any noise. Source: Demir, Mehrotra, Roychowdhury 2000, Phase noise in oscillators, doi 10.1109/81.847872 (the phase
    of a free oscillator under noise is a random walk).
    """
    per_cycle = oscillation.samples_per_cycle
    if per_cycle is None or record.samples < (FEWEST_CYCLES + SMOOTHED_CYCLES) * per_cycle:
        return None
    pv = _of_signal(without_line(record.pv), per_cycle)
    if pv is None or pv.jitter >= uneven:
        return pv
    op = _of_signal(without_line(record.op), per_cycle)
    if op is None:
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
    unlike = float(np.std(x - _mean_cycle(x, (1.0 + slope) / per_cycle)) / np.std(x))
    return Timekeeping(float(np.sqrt(WALK_LEFT_BY_LINE * variance / len(phase))), unlike)


def _mean_cycle(x: FloatArray, frequency: float) -> FloatArray:
    """(N,) the cycle that is nearest to all cycles of x (N,), of a frequency in cycles a sample: straight lines between
    as many knots as a cycle has samples.
    """
    knots = max(3, min(MOST_KNOTS, round(1.0 / frequency)))
    place = knots * (frequency * np.arange(len(x)) % 1.0)
    left = place.astype(np.int64) % knots
    right, far = (left + 1) % knots, place % 1.0
    near = 1.0 - far
    normal = np.diag(np.bincount(left, near**2, knots) + np.bincount(right, far**2, knots))
    beside, at = np.bincount(left, near * far, knots), np.arange(knots)
    normal[at, (at + 1) % knots] += beside
    normal[(at + 1) % knots, at] += beside
    told = np.bincount(left, near * x, knots) + np.bincount(right, far * x, knots)
    # The ridge leaves knots at zero at which no sample tells anything.
    height = np.linalg.solve(normal + RIDGE * len(x) * np.eye(knots), told)
    return np.asarray(near * height[left] + far * height[right])
