"""Horch's cross-correlation: odd between OP and PV of a sticky valve, even under an outer disturbance."""

import numpy as np
from scipy import fft

from app.engine.corroborate.case import Case
from app.engine.corroborate.corroboration import Corroboration, Method, Says
from app.engine.features import ShapeWindow
from app.engine.features.window import PER_CYCLE
from app.engine.recording import FloatArray

_NO_STICTION = 1.0 / 3.0
METHOD = Method(
    "cross_correlation",
    threshold=2.0 / 3.0,
    lower=_NO_STICTION,
    source="Horch 1999, Control Engineering Practice 7, 1221-1231",
)
# The values of d_rho at which sines are 60 and 30 degrees off the even case, as 2/3 and 1/3 are those of d_tau.
_RHO_STICTION = 1.0 / 3.0
_RHO_NONE = (2.0 - np.sqrt(3.0)) / (2.0 + np.sqrt(3.0))
_LAGS = 3 * PER_CYCLE // 4


def cross_correlation(case: Case) -> Corroboration:
    """d_tau = abs(tau_l - tau_r) / (tau_l + tau_r), of the zero crossings of the cross-correlation beside lag zero.

    For loops with a self-regulating process under PI control that oscillate regularly, the set point being constant.
    d_rho = abs(r_0 - r_opt) / abs(r_0 + r_opt) compares lag zero with the largest value between the two crossings.
    Stiction where d_tau > 2/3 and d_rho > 1/3, none where d_tau <= 1/3 and d_rho <= 0.072, undecided between. Misleads
    under derivative action and where tight tuning has PV and OP in quadrature, which the source excludes.
    """
    if case.why_not_self_regulating:
        return METHOD.refuse(case.why_not_self_regulating)
    r = np.mean([_correlation(window) for window in case.windows], axis=0)
    left, right = _crossing(r[_LAGS::-1]), _crossing(r[_LAGS:])
    if left is None or right is None:
        return METHOD.refuse("the cross-correlation of OP and PV does not cross zero on both sides of lag zero")
    d_tau, d_rho = abs(left - right) / (left + right + 1e-12), _d_rho(r, left, right)
    what = f"asymmetry of the cross-correlation of OP and PV, d_rho = {d_rho:.2g}{case.assumed}"
    return METHOD.decided(d_tau, _says(d_tau, d_rho), what)


def _says(d_tau: float, d_rho: float) -> Says | None:
    if d_tau > METHOD.threshold and d_rho > _RHO_STICTION:
        return "stiction"
    return "no_stiction" if d_tau <= _NO_STICTION and d_rho <= _RHO_NONE else None


def _correlation(window: ShapeWindow) -> FloatArray:
    """Cross-correlation at the lags -_LAGS.._LAGS."""
    n = len(window.pv)
    size = fft.next_fast_len(n + _LAGS + 1, real=True)
    full = fft.irfft(fft.rfft(window.op, size) * np.conj(fft.rfft(window.pv, size)), size) / n
    return np.concatenate((full[-_LAGS:], full[: _LAGS + 1]))


def _crossing(r: FloatArray) -> float | None:
    """Lag of the first zero crossing of r (L,), counted from its first value."""
    changed = np.flatnonzero((r[1:] >= 0.0) != (r[:-1] >= 0.0))
    if len(changed) == 0:
        return None
    i = int(changed[0])
    return i + float(r[i] / (r[i] - r[i + 1]))


def _d_rho(r: FloatArray, left: float, right: float) -> float:
    between = r[_LAGS - int(left) : _LAGS + int(right) + 1]
    zero, best = float(r[_LAGS]), float(between[np.argmax(np.abs(between))])
    return abs(zero - best) / (abs(zero + best) + 1e-12)
