"""The wave forms of OP and PV: triangle, sine, rectangle or noise."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

from app.engine.features.window import PER_CYCLE, ShapeWindow
from app.engine.recording import FloatArray
from app.engine.signals.sampled import REORDERED_SUMS, ROUNDING, deviation, hann, log_kurtosis, mean, skewness

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
    pv_power, op_power = harmonic_shares(window.pv, window.op)
    values: list[float] = [
        *_wave_forms(window.pv, window.op, window.pv_smooth, window.op_smooth),
        *pv_power.tolist(),
        *op_power.tolist(),
        _roughness(window.pv, window.pv_smooth),
        _roughness(window.op, window.op_smooth),
        bicoherence(window.pv),
        bicoherence(window.op),
    ]
    return Shape(*values)


@njit(cache=True, nogil=True)
def _wave_forms(pv: FloatArray, op: FloatArray, pv_smooth: FloatArray, op_smooth: FloatArray) -> tuple[float, ...]:
    """What `Shape` has up to the spectra, in its order."""
    dpv, dop = pv_smooth[1:] - pv_smooth[:-1], op_smooth[1:] - op_smooth[:-1]
    return (
        log_kurtosis(pv),
        log_kurtosis(op),
        log_kurtosis(dpv),
        log_kurtosis(dop),
        triangle_index(pv_smooth),
        triangle_index(op_smooth),
        skewness(pv_smooth),
        skewness(op_smooth),
        skewness(dpv),
        skewness(dop),
    )


def _roughness(x: FloatArray, smooth: FloatArray) -> float:
    return float(np.log10(deviation(x - smooth) ** 2 + 1e-4))


def harmonic_shares(one: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(5,) shares of the power of each of two signals (n,): below the fundamental, fundamental, second, third, above.

    Real and imaginary part of one transform, whose lines at k and -k tell the two apart.
    """
    lines = fft.fft(_side_by_side(one, other, hann(len(one))), overwrite_x=True)
    shares: tuple[FloatArray, FloatArray] = _shares_between(lines, _HARMONIC_EDGES)
    return shares


@njit(cache=True, nogil=True)
def _side_by_side(one: FloatArray, other: FloatArray, taper: FloatArray) -> ComplexArray:
    both = np.empty(len(taper), dtype=np.complex128)
    for i in range(len(taper)):
        both[i] = complex(one[i] * taper[i], other[i] * taper[i])
    return both


@njit(cache=True, nogil=True)
def _shares_between(lines: ComplexArray, edges: tuple) -> tuple[FloatArray, FloatArray]:
    """(bands,) shares of the power of two signals, of whose transform (n,) these are the lines, below each of these
    edges, in lines a cycle.
    """
    samples, band = len(lines), 0
    one, other = np.zeros(len(edges)), np.zeros(len(edges))
    for k in range(samples // 2 + 1):
        while k * PER_CYCLE / samples >= edges[band]:
            band += 1
        up, down = lines[k], lines[-k].conjugate()
        first, second = up + down, up - down
        one[band] += first.real**2 + first.imag**2
        other[band] += second.real**2 + second.imag**2
    # Of powers four times as large as those of each signal by itself.
    return one / (one.sum() + 4e-12), other / (other.sum() + 4e-12)


def bicoherence(x: FloatArray) -> float:
    """Mean squared bicoherence of x (n,), weighted by amplitude, less what that many segments of noise would show.

    Segments of two cycles, half overlapping. 0 where fewer than four fit.
    """
    size = 2 * PER_CYCLE
    segments = _segments(x, hann(size))
    if len(segments) < _FEWEST_SEGMENTS:
        return 0.0
    return _coupling(fft.rfft(segments, axis=1, overwrite_x=True), _BISPECTRUM_LINES) - 1.0 / len(segments)


@njit(cache=True, nogil=True)
def _segments(x: FloatArray, taper: FloatArray) -> FloatArray:
    """(segments, size) of x (n,) about their means, tapered (size,), each half over the next; none where n < size."""
    size = len(taper)
    segments = np.empty((max(0, (len(x) - size) // (size // 2) + 1), size))
    for k in range(len(segments)):
        piece = x[k * (size // 2) : k * (size // 2) + size]
        segments[k] = (piece - mean(piece)) * taper
    return segments


@njit(cache=True, nogil=True, error_model="numpy")
def _coupling(lines: ComplexArray, below: int) -> float:
    """Mean squared bicoherence of the pairs of lines 1..below-1 of lines (segments, lines), weighted by amplitude."""
    segments = lines.shape[0]
    reached = lines[:, : 2 * below - 1].T
    real, imag, size = reached.real.copy(), reached.imag.copy(), np.abs(reached)
    total = whole = 0.0
    for i in range(1, below):
        for j in range(1, i + 1):
            squared, weight = _coupling_of(real, imag, size, i, j)
            twice = 1.0 if i == j else 2.0  # lines j and i couple as i and j do
            total += twice * squared * (weight / segments**2)
            whole += twice * (weight / segments**2)
    return total / (whole + 1e-12)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=REORDERED_SUMS)
def _coupling_of(real: FloatArray, imag: FloatArray, size: FloatArray, i: int, j: int) -> tuple[float, float]:
    """Squared bicoherence of the lines i and j, and the product of the summed amplitudes of their pair and of line
    i + j; real, imag, size: (lines, segments) parts of the lines and their amplitudes.
    """
    coupled_real = coupled_imag = pair_power = sum_power = pair_size = sum_size = 0.0
    p, q, r, s, u, v = real[i], imag[i], real[j], imag[j], real[i + j], imag[i + j]
    for k in range(len(p)):
        pair_real, pair_imag = p[k] * r[k] - q[k] * s[k], p[k] * s[k] + q[k] * r[k]
        coupled_real += pair_real * u[k] + pair_imag * v[k]
        coupled_imag += pair_imag * u[k] - pair_real * v[k]
        pair, other = size[i, k] * size[j, k], size[i + j, k]
        pair_power += pair * pair
        sum_power += other * other
        pair_size += pair
        sum_size += other
    return (coupled_real**2 + coupled_imag**2) / (pair_power * sum_power + 1e-12), pair_size * sum_size


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
        rise, fall = 10.0 / k, 10.0 / (10 - k)
        for i in range(n):
            form[i] = min(t[i] * rise, (1.0 - t[i]) * fall)
        triangle = min(triangle, _misfit(half, form))
    return sine / (sine + triangle + 1e-12)


@njit(cache=True, nogil=True, fastmath=REORDERED_SUMS)
def _misfit(half: FloatArray, form: FloatArray) -> float:
    top = bottom = left = 0.0
    for i in range(len(half)):
        top += half[i] * form[i]
        bottom += form[i] * form[i]
    gain = top / bottom
    for i in range(len(half)):
        left += (half[i] - gain * form[i]) ** 2
    return left
