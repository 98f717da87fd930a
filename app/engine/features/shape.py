"""The wave forms of OP and PV: triangle, sine, rectangle or noise."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

from app.engine.features.window import PER_CYCLE, ShapeWindow
from app.engine.recording import FloatArray
from app.engine.signals.sampled import ROUNDING, deviation, hann, log_kurtosis, skewness

ComplexArray = NDArray[np.complex128]

_HARMONIC_EDGES = (0.5, 1.5, 2.5, 3.5, np.inf)
_FEWEST_HALF_CYCLE = 8
_BISPECTRUM_LINES = 12
_FEWEST_SEGMENTS = 4


@dataclass(frozen=True)
class Shape:
    """Wave forms; pv_* and op_* in turn.

    *_kurtosis, *_slope_kurtosis: logarithm of the kurtosis of the signal and of its smoothed slope.
    *_triangle: triangle against sine over half cycles, above 0.5 a triangle (He et al. 2007, doi 10.1021/ie061219a).
    *_skewness, *_slope_skewness: absolute; a linear loop under Gaussian disturbance has none.
    *_slow, *_fundamental, *_second, *_third, *_fast: shares of power below, in and above the fundamental.
    *_roughness: log10 of the variance that smoothing takes off.
    *_bicoherence: mean squared bicoherence of the lowest lines above that of noise (Choudhury et al. 2004,
    doi 10.1016/j.automatica.2004.03.022).
    """

    pv_kurtosis: float
    op_kurtosis: float
    pv_slope_kurtosis: float
    op_slope_kurtosis: float
    pv_triangle: float
    op_triangle: float
    pv_skewness: float
    op_skewness: float
    pv_slope_skewness: float
    op_slope_skewness: float
    pv_slow: float
    pv_fundamental: float
    pv_second: float
    pv_third: float
    pv_fast: float
    op_slow: float
    op_fundamental: float
    op_second: float
    op_third: float
    op_fast: float
    pv_roughness: float
    op_roughness: float
    pv_bicoherence: float
    op_bicoherence: float


def shape(window: ShapeWindow) -> Shape:
    """The features of `Shape` for one window."""
    pv, op = window.pv_smooth, window.op_smooth
    dpv, dop = np.diff(pv), np.diff(op)
    pv_power, op_power = harmonic_shares(window.pv), harmonic_shares(window.op)
    return Shape(
        pv_kurtosis=log_kurtosis(window.pv),
        op_kurtosis=log_kurtosis(window.op),
        pv_slope_kurtosis=log_kurtosis(dpv),
        op_slope_kurtosis=log_kurtosis(dop),
        pv_triangle=triangle_index(pv),
        op_triangle=triangle_index(op),
        pv_skewness=skewness(pv),
        op_skewness=skewness(op),
        pv_slope_skewness=skewness(dpv),
        op_slope_skewness=skewness(dop),
        pv_slow=float(pv_power[0]),
        pv_fundamental=float(pv_power[1]),
        pv_second=float(pv_power[2]),
        pv_third=float(pv_power[3]),
        pv_fast=float(pv_power[4]),
        op_slow=float(op_power[0]),
        op_fundamental=float(op_power[1]),
        op_second=float(op_power[2]),
        op_third=float(op_power[3]),
        op_fast=float(op_power[4]),
        pv_roughness=float(np.log10(deviation(window.pv - pv) ** 2 + 1e-4)),
        op_roughness=float(np.log10(deviation(window.op - op) ** 2 + 1e-4)),
        pv_bicoherence=bicoherence(window.pv),
        op_bicoherence=bicoherence(window.op),
    )


def harmonic_shares(x: FloatArray) -> FloatArray:
    """(5,) shares of the power of x (n,): below the fundamental, fundamental, second, third, above."""
    shares: FloatArray = _shares_between(fft.rfft(x * hann(len(x))), len(x), _HARMONIC_EDGES)
    return shares


@njit(cache=True, nogil=True)
def _shares_between(lines: ComplexArray, samples: int, edges: tuple) -> FloatArray:
    """(bands,) shares of the power of the lines of so many samples below each of these edges, in lines a cycle."""
    shares, band = np.zeros(len(edges)), 0
    for k in range(len(lines)):
        while k * PER_CYCLE / samples >= edges[band]:
            band += 1
        shares[band] += lines[k].real ** 2 + lines[k].imag ** 2
    return shares / (shares.sum() + 1e-12)


def bicoherence(x: FloatArray) -> float:
    """Mean squared bicoherence of x (n,), weighted by amplitude, less what that many segments of noise would show.

    Segments of two cycles, half overlapping. 0 where fewer than four fit.
    """
    size = 2 * PER_CYCLE
    starts = range(0, len(x) - size + 1, size // 2)
    if len(starts) < _FEWEST_SEGMENTS:
        return 0.0
    pieces = np.array([x[s : s + size] for s in starts])
    lines = fft.rfft((pieces - pieces.mean(axis=1, keepdims=True)) * hann(size), axis=1)
    return _coupling(lines, _BISPECTRUM_LINES) - 1.0 / len(starts)


@njit(cache=True, nogil=True, error_model="numpy")
def _coupling(lines: ComplexArray, below: int) -> float:
    """Mean squared bicoherence of the pairs of lines 1..below-1 of lines (segments, lines), weighted by amplitude."""
    segments = lines.shape[0]
    total = whole = 0.0
    for i in range(1, below):
        for j in range(1, below):
            coupled = 0.0j
            pair_power = sum_power = pair_size = sum_size = 0.0
            for k in range(segments):
                pair, other = lines[k, i] * lines[k, j], lines[k, i + j]
                coupled += pair * other.conjugate()
                pair_square = pair.real**2 + pair.imag**2
                sum_square = other.real**2 + other.imag**2
                pair_power += pair_square
                sum_power += sum_square
                pair_size += np.sqrt(pair_square)
                sum_size += np.sqrt(sum_square)
            squared = (coupled.real**2 + coupled.imag**2) / (pair_power * sum_power + 1e-12)
            weight = (sum_size / segments) * (pair_size / segments)
            total += squared * weight
            whole += weight
    return total / (whole + 1e-12)


@njit(cache=True, nogil=True)
def triangle_index(x: FloatArray) -> float:
    """Triangle against sine over the half cycles of x (n,) between zero crossings: E_sine / (E_sine + E_triangle).

    The peak of the triangle is free between 0.2 and 0.8 of the half cycle. 0.5 where no half cycle is long enough.
    """
    total = weight = 0.0
    start, side = -1, 0.0
    for i in range(len(x)):
        # What lies on zero but for rounding stays on the side where it was.
        if abs(x[i]) <= ROUNDING or x[i] * side > 0.0:
            continue
        crossed, side = side != 0.0, x[i]
        if not crossed:
            continue
        if start >= 0 and i - start >= _FEWEST_HALF_CYCLE:
            half = np.abs(x[start:i])
            energy = np.sum(half * half)
            total += energy * _half_cycle(half)
            weight += energy
        start = i
    return total / weight if weight > 0.0 else 0.5


@njit(cache=True, nogil=True)
def _half_cycle(half: FloatArray) -> float:
    n, triangle = len(half), np.inf
    t, form = np.empty(n), np.empty(n)
    for i in range(n):
        t[i] = (i + 0.5) / n
        form[i] = np.sin(np.pi * t[i])
    sine = _misfit(half, form)
    for k in range(2, 9):
        peak = 0.1 * k
        for i in range(n):
            form[i] = min(t[i] / peak, (1.0 - t[i]) / (1.0 - peak))
        triangle = min(triangle, _misfit(half, form))
    return sine / (sine + triangle + 1e-12)


@njit(cache=True, nogil=True)
def _misfit(half: FloatArray, form: FloatArray) -> float:
    top = bottom = left = 0.0
    for i in range(len(half)):
        top += half[i] * form[i]
        bottom += form[i] * form[i]
    gain = top / bottom
    for i in range(len(half)):
        left += (half[i] - gain * form[i]) ** 2
    return left
