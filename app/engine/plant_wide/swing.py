"""What is kept of a loop's oscillation so that loops can be compared without their samples: a few spectral lines."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import hann, without_line

ComplexArray = NDArray[np.complexfloating[Any, Any]]

LINES_EACH_SIDE = 8
BAND_EDGES_HZ = np.logspace(-5.5, 0.5, 73)
"""Twelve bands a decade, from half a week to a third of a second: the same for every loop, so that bands compare."""

_NEAR = 0.1


@dataclass(frozen=True, eq=False)
class Swing:
    """The oscillation of one loop's PV.

    start_s, length_s: of the stretch that was transformed, in seconds on a clock that the compared loops share.
    period_s: as the oscillation detector has it; the lines are about the strongest one near it.
    strength, regularity: likewise as the detector has them.
    first_line: number of the first of `lines`: line k swings with k / length_s Hz.
    lines: (L,) complex amplitudes of PV about that period, Hann window, at unit norm.
    bands: (72,) share of PV's power in each band of BAND_EDGES_HZ, smoothed over neighbours, at unit norm as amplitude.
    """

    start_s: float
    length_s: float
    period_s: float
    strength: float
    regularity: float
    first_line: int
    lines: ComplexArray
    bands: FloatArray

    @property
    def cycles(self) -> float:
        return self.length_s / self.period_s


def swing_of(record: UniformRecord, oscillation: Oscillation) -> Swing | None:
    """The lines of PV about the period of `oscillation`, or None where it is not regular or PV has nothing there.

    record: what the oscillation was found in. The narrow band about the period keeps how amplitude and phase wander,
    which is what tells loops that are shaken by the same thing from loops that have the same period by chance.
    """
    if not oscillation.regular or oscillation.period_s is None or np.ptp(record.pv) == 0.0:
        return None
    n = record.samples
    # By a power of two, so exactly: lines and bands are shares, and the square of 1e-200 is none.
    pv = np.ldexp(record.pv, -int(np.frexp(np.max(np.abs(record.pv)))[1]))
    spectrum = np.fft.rfft(without_line(pv) * hann(n))
    peak = _peak(np.abs(spectrum), n * record.sampling_interval_s / oscillation.period_s)
    if peak is None:
        return None
    first = max(1, peak - LINES_EACH_SIDE)
    lines = spectrum[first : peak + LINES_EACH_SIDE + 1]
    length_s = n * record.sampling_interval_s
    return Swing(
        start_s=record.start_s,
        length_s=length_s,
        period_s=oscillation.period_s,
        strength=oscillation.strength,
        regularity=oscillation.regularity,
        first_line=first,
        lines=lines / np.linalg.norm(lines),
        bands=_bands(np.abs(spectrum) ** 2, length_s),
    )


def _peak(amplitude: FloatArray, cycles: float) -> int | None:
    """Number of the greatest line within 10 % of `cycles`, at least one line to each side."""
    reach = max(1.0, _NEAR * cycles)
    low, high = max(1, int(np.floor(cycles - reach))), min(len(amplitude), int(np.ceil(cycles + reach)) + 1)
    if high - low < 1 or not np.any(amplitude[low:high] > 0.0):
        return None
    return low + int(np.argmax(amplitude[low:high]))


def _bands(power: FloatArray, length_s: float) -> FloatArray:
    frequency_hz = np.arange(1, len(power)) / length_s
    share, _ = np.histogram(frequency_hz, BAND_EDGES_HZ, weights=power[1:])
    # A line near an edge falls into one band here and into the next one there: neighbours share.
    smooth = np.convolve(share, (0.25, 0.5, 0.25), mode="same")
    total = float(smooth.sum())
    return np.sqrt(smooth / total) if total > 0.0 else smooth
