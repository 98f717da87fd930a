"""Damarla's sigmoid: OP over the move of PV is S-shaped when the valve sticks."""

import numpy as np
from numba import njit

from app.engine.corroborate.case import Case
from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features import ShapeWindow
from app.engine.recording import FloatArray

METHOD = Method(
    "sigmoid",
    threshold=0.5,
    source="Damarla, Sun, Xu, Shah, Huang 2022, IEEE AdCONIP, Vancouver, 210-215",
)
_ITERATIONS = 25
_LARGEST = 30.0


def sigmoid(case: Case) -> Corroboration:
    """Correlation of OP with the sigmoid 1 / (1 + exp(-(a dPV + b))) fitted to it, a and b by least squares.

    For loops with a self-regulating process that oscillate regularly: where it integrates, OP and the move of PV lie in
    line when the valve does not stick. Above 0.5 stiction, else not. Scaling, step and threshold are those of a public
    implementation of the paper, the paper itself not being at hand: OP on 0..1 over the window; the step of PV, here of
    PV smoothed over about an eighth of a cycle, at unit deviation. Misleads for all that puts OP and PV in quadrature.
    """
    if case.why_not_self_regulating:
        return METHOD.refuse(case.why_not_self_regulating)
    correlations = [_fit(window) for window in case.windows]
    return METHOD.answer(float(np.mean(correlations)), f"sigmoid of the move of PV in OP{case.assumed}")


def _fit(window: ShapeWindow) -> float:
    step, op = np.diff(window.pv_smooth), window.op_smooth[1:]
    spread = float(np.std(step))
    if spread <= 0.0 or np.ptp(op) <= 0.0:
        return 0.0
    return fitted_correlation((step - step.mean()) / spread, (op - op.min()) / np.ptp(op))


@njit(cache=True, nogil=True)
def fitted_correlation(x: FloatArray, y: FloatArray) -> float:
    """Correlation of y (n,) in 0..1 with the sigmoid of x (n,) that fits it best (Levenberg and Marquardt)."""
    a, b = 4.0 * np.mean((x - x.mean()) * (y - y.mean())), 0.0
    damping, best, best_a, best_b = 1e-2, np.inf, a, b
    aa, ab, bb, ga, gb = 0.0, 0.0, 0.0, 0.0, 0.0
    for _ in range(_ITERATIONS):
        s = 1.0 / (1.0 + np.exp(-np.minimum(np.maximum(a * x + b, -_LARGEST), _LARGEST)))
        slope, rest = s * (1.0 - s), y - s
        cost = np.sum(rest * rest)
        if cost < best:
            gained, best, best_a, best_b = best - cost, cost, a, b
            aa, ab, bb = np.sum((slope * x) ** 2), np.sum(slope * slope * x), np.sum(slope * slope)
            ga, gb = np.sum(slope * x * rest), np.sum(slope * rest)
            damping *= 0.5
            if gained < 1e-12 * cost:
                break
        else:
            damping *= 10.0
        determinant = aa * bb * (1.0 + damping) ** 2 - ab * ab
        if determinant <= 0.0:
            break
        a = best_a + (ga * bb * (1.0 + damping) - gb * ab) / determinant
        b = best_b + (gb * aa * (1.0 + damping) - ga * ab) / determinant
    s = 1.0 / (1.0 + np.exp(-np.minimum(np.maximum(best_a * x + best_b, -_LARGEST), _LARGEST)))
    ds, dy = s - s.mean(), y - y.mean()
    scale = np.sqrt(np.sum(ds * ds) * np.sum(dy * dy))
    return np.sum(ds * dy) / scale if scale > 0.0 else 0.0
