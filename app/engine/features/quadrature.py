"""How OP and PV lie to each other: in line (the controller passes PV on) or in quadrature (a stuck valve)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit

from app.engine.features.window import PER_CYCLE, ShapeWindow
from app.engine.recording import FloatArray
from app.engine.signals.sampled import ROUNDING, correlation, dot, hann

_SEGMENT = 3 * PER_CYCLE
# In segments of three cycles the fundamental is line 3; its neighbours belong to it where the period wanders.
_FUNDAMENTAL = (2, 3, 4, 5)


@dataclass(frozen=True)
class Quadrature:
    """Odd and even parts of the cross-correlation of OP and PV (Horch 1999), and kin.

    ccf_odd, ccf_even: largest odd and even part within half a cycle, 0..1. ccf_zero: at lag zero.
    op_dpv, pv_dop, dpv_dop: correlations of OP with the slope of PV, of PV with the slope of OP, of the slopes.
    loop_area: area that PV encloses over OP in a cycle; 1 for an ellipse in quadrature at unit deviations.
    pv_direction, dpv_direction: correlation of PV, and of its slope, with the direction of OP.
    op_pv_direction: correlation of OP with the direction of PV.
    coherence_odd, coherence_even: imaginary and real part of the coherency at the fundamental.
    odd_share, phase_sine: the odd part against the value at lag zero, and the sine of the phase at the fundamental:
    the same without the strength of the coupling.
    Source: Horch 1999, doi 10.1016/S0967-0661(99)00100-8.
    """

    ccf_odd: float
    ccf_even: float
    ccf_zero: float
    op_dpv: float
    pv_dop: float
    dpv_dop: float
    loop_area: float
    pv_direction: float
    dpv_direction: float
    op_pv_direction: float
    coherence_odd: float
    coherence_even: float
    odd_share: float
    phase_sine: float


def quadrature(window: ShapeWindow) -> Quadrature:
    """The features of `Quadrature` for one window. Every sign is dropped: the sign of PV and OP is free."""
    pv, op, dpv, dop = window.pv_smooth, window.op_smooth, window.pv_slope, window.op_slope
    area = abs(float(op @ dpv)) / len(pv) * PER_CYCLE / (2 * np.pi)
    waves = _tapered(min(_SEGMENT, len(pv)))
    return Quadrature(*_in_quadrature(window.pv, window.op, pv, op, dpv, dop, waves, area))


@njit(cache=True, nogil=True)
def _in_quadrature(
    pv: FloatArray,
    op: FloatArray,
    pv_smooth: FloatArray,
    op_smooth: FloatArray,
    dpv: FloatArray,
    dop: FloatArray,
    waves: FloatArray,
    area: float,
) -> tuple[float, ...]:
    """What `Quadrature` has, in its order."""
    odd, even, zero = _cross_correlation(pv, op)
    coherency, op_direction = _coherency(pv, op, waves), _direction(dop)
    return (
        odd,
        max(even, zero),
        zero,
        abs(correlation(op_smooth, dpv)),
        abs(correlation(pv_smooth, dop)),
        abs(correlation(dpv, dop)),
        area,
        abs(correlation(pv, op_direction)),
        abs(correlation(dpv, op_direction)),
        abs(correlation(op, _direction(dpv))),
        abs(coherency.imag),
        abs(coherency.real),
        odd / (odd + zero + 1e-9),
        abs(coherency.imag) / (abs(coherency) + 1e-9),
    )


@njit(cache=True, nogil=True)
def _direction(slope: FloatArray) -> FloatArray:
    """Sign of a slope; 0 where a signal at unit deviation only moves by rounding."""
    return np.where(np.abs(slope) > ROUNDING, np.sign(slope), 0.0)


@njit(cache=True, nogil=True)
def _cross_correlation(pv: FloatArray, op: FloatArray) -> tuple[float, float, float]:
    """Cross-correlation: its largest odd and its largest even part at lags 1..half a cycle, and its size at zero."""
    forward, backward = _lagged_means(op, pv), _lagged_means(pv, op)
    odd = even = 0.0
    for lag in range(1, len(forward)):
        odd = max(odd, abs(forward[lag] - backward[lag]) / 2)
        even = max(even, abs(forward[lag] + backward[lag]) / 2)
    return odd, even, abs(forward[0])


@njit(cache=True, nogil=True)
def _lagged_means(late: FloatArray, early: FloatArray) -> FloatArray:
    """(half a cycle + 1,) means over all samples (n,) of the products of one with the other so many samples before."""
    n = len(late)
    means = np.zeros(PER_CYCLE // 2 + 1)
    for lag in range(min(len(means), n)):
        means[lag] = dot(late[lag:], early[: n - lag]) / n
    return means


@lru_cache(maxsize=64)
def _tapered(size: int) -> FloatArray:
    """(2 lines, size) cosines and sines of the lines of the fundamental over a segment of so many samples, tapered."""
    phase = 2.0 * np.pi / _SEGMENT * np.outer(_FUNDAMENTAL, np.arange(size))
    waves = np.concatenate([np.cos(phase), -np.sin(phase)]) * hann(size)
    waves.flags.writeable = False
    return waves


@njit(cache=True, nogil=True)
def _coherency(pv: FloatArray, op: FloatArray, waves: FloatArray) -> complex:
    """waves: `_tapered`. Over segments of their length that overlap by half."""
    lines, size = len(waves) // 2, waves.shape[1]
    pv_power = op_power = 0.0
    cross = 0.0j
    for start in range(0, len(pv) - size + 1, max(size // 2, 1)):
        y, u = pv[start : start + size], op[start : start + size]
        for k in range(lines):
            real, imag = waves[k], waves[lines + k]
            of_pv, of_op = complex(dot(y, real), dot(y, imag)), complex(dot(u, real), dot(u, imag))
            pv_power += of_pv.real**2 + of_pv.imag**2
            op_power += of_op.real**2 + of_op.imag**2
            cross += of_pv * of_op.conjugate()
    power = np.sqrt(pv_power * op_power)
    return cross / power if power > 0.0 else 0.0j
