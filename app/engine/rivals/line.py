"""Whether a signal is one line of its spectrum: narrow, and without harmonics above the noise beside them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.engine.features import PER_CYCLE
from app.engine.recording import FloatArray
from app.engine.signals.sampled import hann

FEWEST_CYCLES = 10
"""Fewer leave no room between the harmonics to see the noise."""
_FINER = 8
_OFF_PERIOD = 0.06
_LOBE_BINS = 2
_NOISE_BINS = np.array([-7, -6, -5, -4, -3, 3, 4, 5, 6, 7])
_NOISE_COUNTS = 1.5


@dataclass(frozen=True)
class Line:
    """share: share of the power within half a frequency of the fundamental that lies within the width of a steady sine.

    third: amplitude of the third harmonic over that of the fundamental, at the largest value that the noise allows; 1/9
    in a triangle, 1/3 in a square. loudest: amplitude of the second or third harmonic over that of the noise beside it.
    """

    share: float
    third: float
    loudest: float


def line(x: FloatArray) -> Line | None:
    """The line of x (n,) at PER_CYCLE samples a cycle, with drift removed; None below FEWEST_CYCLES.

    Uses Hann's window. The frequency is searched within 6 % of that of the cycle.
    """
    n = len(x)
    if n < FEWEST_CYCLES * PER_CYCLE:
        return None
    low, high = (round(_FINER * n / PER_CYCLE * (1.0 + off)) for off in (-_OFF_PERIOD, _OFF_PERIOD))
    beyond_third = 3 * high + _FINER * (int(_NOISE_BINS[-1]) + 1)
    amplitude = np.abs(np.fft.rfft(x * hann(n), _FINER * n)[:beyond_third])
    first = low + int(np.argmax(amplitude[low : high + 1]))
    fundamental = float(amplitude[first]) or 1.0
    (second, second_noise), (third, third_noise) = (_harmonic(amplitude, order * first) for order in (2, 3))
    return Line(
        _share(amplitude, first),
        float(np.hypot(third, _NOISE_COUNTS * third_noise)) / fundamental,
        max(second / second_noise, third / third_noise),
    )


def worst(lines: Sequence[Line | None]) -> Line | None:
    """What holds for all of them; None if one of them is unknown."""
    known = [narrow for narrow in lines if narrow is not None]
    if not known or len(known) < len(lines):
        return None
    return Line(min(x.share for x in known), max(x.third for x in known), max(x.loudest for x in known))


def _share(amplitude: FloatArray, first: int) -> float:
    near = amplitude[first // 2 : first + first // 2 + 1]
    lobe = amplitude[first - _LOBE_BINS * _FINER : first + _LOBE_BINS * _FINER + 1]
    return float(np.sum(lobe**2) / (np.sum(near**2) or 1.0))


def _harmonic(amplitude: FloatArray, place: int) -> tuple[float, float]:
    """The largest amplitude within a bin of the harmonic, and that of the noise beside it."""
    noise = float(np.sqrt(np.mean(amplitude[place + _FINER * _NOISE_BINS] ** 2))) or 1e-300
    return float(np.max(amplitude[place - _FINER : place + _FINER + 1])), noise
