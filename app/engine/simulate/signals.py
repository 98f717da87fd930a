"""What drives a simulated loop from outside: set-point programmes, loads, drifts, waves and coloured noise."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from app.engine.recording import FloatArray
from app.engine.simulate.digits import in_seven_digits

WaveForm = Literal["sine", "square", "triangle"]


@dataclass(frozen=True)
class Wave:
    """A periodic part: its amplitude (half of peak to peak, in the unit of the signal), period and phase."""

    amplitude: float
    period_s: float
    form: WaveForm = "sine"
    phase_rad: float = 0.0


@dataclass(frozen=True)
class Signal:
    """A signal over time: value + steps + waves + drift + coloured noise.

    value: the constant part, in the signal's unit.
    steps: (time in s, change) pairs; each change stays from its time on.
    waves: periodic parts, added up.
    drift_per_s: slope in unit per s from time zero on.
    noise_sd: standard deviation of the stationary noise; 0 for none.
    noise_tau_s: its correlation time in s (first-order coloured); 0 for white.
    """

    value: float = 0.0
    steps: tuple[tuple[float, float], ...] = ()
    waves: tuple[Wave, ...] = ()
    drift_per_s: float = 0.0
    noise_sd: float = 0.0
    noise_tau_s: float = 0.0

    def sample(self, time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
        """(N,) values at time_s: (N,) in s, uniformly spaced; rng is used for the noise only."""
        out = _steps(self, time_s)
        for wave in self.waves:
            out += wave.amplitude * _form(wave, time_s)
        if self.drift_per_s:
            out += self.drift_per_s * np.maximum(time_s, 0.0)
        if self.noise_sd:
            out += _coloured(self, time_s, rng)
        return out


def _steps(spec: Signal, time_s: FloatArray) -> FloatArray:
    """A step that falls on a sample is seen by that sample, whatever the rounding of its time."""
    slack = 1e-6 * (time_s[1] - time_s[0]) if len(time_s) > 1 else 0.0
    out = np.full(len(time_s), float(spec.value))
    begins = np.searchsorted(time_s, [at_s - slack for at_s, _ in spec.steps])
    # Added in their own order, not in that of time: the rounding of a sum decides what networks learn from it.
    for begin, (_, change) in zip(begins, spec.steps, strict=True):
        out[begin:] += change
    return out


def _form(wave: Wave, time_s: FloatArray) -> FloatArray:
    angle = 2.0 * np.pi * time_s / wave.period_s + wave.phase_rad
    if wave.form == "sine":
        return in_seven_digits(np.sin(angle))
    if wave.form == "square":
        # Half-open halves: a sample that falls on an edge belongs to what follows, whatever the rounding.
        return np.where(np.mod(angle + 1e-9, 2.0 * np.pi) < np.pi, 1.0, -1.0)
    return scipy.signal.sawtooth(angle + 0.5 * np.pi, width=0.5)


def _coloured(spec: Signal, time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    white = rng.standard_normal(len(time_s))
    if not spec.noise_tau_s or len(time_s) < 2:
        return in_seven_digits(spec.noise_sd * white)
    pole = np.exp(-(time_s[1] - time_s[0]) / spec.noise_tau_s)
    white[1:] *= np.sqrt(1.0 - pole**2)  # the first sample is drawn from the stationary distribution
    return in_seven_digits(spec.noise_sd * scipy.signal.lfilter([1.0], [1.0, -pole], white))
