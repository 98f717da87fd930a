"""Yper: how much of PV stands at frequencies that the controller does not produce (eqs 18-20)."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.engine.recording import BoolArray, FloatArray
from app.errors import DataError

Scaling = Literal["raw", "std", "range"]

THRESHOLD_SHARE = 0.1
"""A of eq 18 as a share of u_max = max(u) - min(u); the paper's value in all its studies."""

SIGNIFICANT_PCT = 0.5
"""Yper above this is significant (remark 4.1)."""


@dataclass(frozen=True, eq=False)
class YperResult:
    """Yper and the three spectra it comes from, over the K = N // 2 frequencies above zero.

    yper_pct: eq 20 in per cent, 0..100.
    frequency_hz: (K,) in Hz.
    pv_amplitude, op_amplitude: (K,) abs(Y), abs(U) of the scaled signals.
    threshold_amplitude: (K,) abs(S_w), the spectrum of s(t) of eq 18.
    significant: (K,) True where Ysig (eq 19) is not zero.
    scaling: how PV and OP were brought to a common unit.
    """

    yper_pct: float
    frequency_hz: FloatArray
    pv_amplitude: FloatArray
    op_amplitude: FloatArray
    threshold_amplitude: FloatArray
    significant: BoolArray
    scaling: Scaling


def compute(pv: FloatArray, op: FloatArray, sampling_interval_s: float, scaling: Scaling = "std") -> YperResult:
    """Yper of a record by eqs 18-20, deviations from the mean.

    pv, op: (N,) finite, uniformly sampled, N >= 4; any unit. sampling_interval_s: Ts in seconds.
    scaling: "raw" leaves the engineering units, as eq 19 is written: it compares the spectrum of PV with a threshold
    made from OP, so the answer changes with the units. "std" brings both to unit standard deviation and "range" both
    to unit range; these two do not change when PV or OP change unit or zero.
    Raises DataError("record_too_short") below 4 samples, DataError("signal_length") where the lengths differ,
    DataError("not_finite") where a value is missing and DataError("flat_signal") where PV or OP never moves.

    Misleads (remarks 4.1-4.3): a large disturbance or any other nonlinearity raises it, and noise alone often lifts it
    above 0.5 %; it measures how far a Hammerstein verdict can be trusted and is not a detector of stiction. A harmonic
    is either counted or not, so a window a few samples longer or shorter can change it several times over.
    Source: Srinivasan, Spinner, Rengaswamy 2015, doi 10.1021/acs.iecr.5b00939.
    """
    _check(pv, op)
    y, u = _scaled(pv, scaling), _scaled(op, scaling)
    s = THRESHOLD_SHARE * np.ptp(u) * np.sign(u)
    pv_amplitude, op_amplitude, threshold_amplitude = (np.abs(np.fft.rfft(x))[1:] for x in (y, u, s))
    significant = (op_amplitude < threshold_amplitude) & (pv_amplitude > threshold_amplitude)
    # Eq 20 sums over the two-sided spectrum: each line stands twice in it, that at half the sampling frequency once.
    weighted = pv_amplitude * 2.0
    if len(y) % 2 == 0:
        weighted[-1] /= 2.0
    return YperResult(
        yper_pct=100.0 * float(weighted[significant].sum() / weighted.sum()),
        frequency_hz=np.fft.rfftfreq(len(y), sampling_interval_s)[1:].astype(np.float64, copy=False),
        pv_amplitude=pv_amplitude,
        op_amplitude=op_amplitude,
        threshold_amplitude=threshold_amplitude,
        significant=significant,
        scaling=scaling,
    )


def _check(pv: FloatArray, op: FloatArray) -> None:
    if len(pv) != len(op):
        raise DataError("signal_length", f"PV has {len(pv):,} samples, OP has {len(op):,}; they must be the same")
    if len(pv) < 4:
        raise DataError("record_too_short", f"Yper needs at least 4 samples, got {len(pv)}")
    for name, signal in (("PV", pv), ("OP", op)):
        if not np.all(np.isfinite(signal)):
            raise DataError("not_finite", f"{name} has missing values; Yper needs a record without gaps")
        if np.ptp(signal) == 0.0:
            raise DataError("flat_signal", f"{name} does not move; Yper needs both signals to move")


def _scaled(signal: FloatArray, scaling: Scaling) -> FloatArray:
    deviation = np.asarray(signal, dtype=np.float64) - np.mean(signal)
    if scaling == "raw":
        return deviation
    # By a power of two, so exactly: the square of 1e-163 is none.
    deviation = np.ldexp(deviation, -int(np.frexp(np.max(np.abs(deviation)))[1]))
    if scaling == "std":
        return deviation / np.std(deviation)
    return deviation / np.ptp(deviation)
