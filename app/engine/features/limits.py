"""What saturation, quantisation and holding leave in a window."""

from dataclasses import dataclass

import numpy as np

from app.engine.features.window import PER_CYCLE, ShapeWindow
from app.engine.recording import BoolArray, FloatArray
from app.engine.signals.sampled import ROUNDING, at_ends, deviation, moving_average, quantiles, without_line

_SAME_STEP = 0.02
_FEWEST_STEPS = 10


@dataclass(frozen=True)
class Limits:
    """Marks of limits and of the instrument.

    op_at_limit: share of the window that OP stands at one of its extremes.
    pv_moves_at_limit: share of the PV movement that happens meanwhile.
    pv_quantum: least step of PV in standard deviations, where nearly all its steps are multiples of it; else 0.
    pv_least_step: log10 of the 5 % quantile of the non-zero steps of PV in standard deviations.
    pv_held, op_held: share of samples equal to the one before.
    """

    op_at_limit: float
    pv_moves_at_limit: float
    pv_quantum: float
    pv_least_step: float
    pv_held: float
    op_held: float


def limits(window: ShapeWindow) -> Limits:
    """The features of `Limits` for one window."""
    low, high = _at_extremes(window.even_op)
    moves = _movement(window.even_pv)
    pv_steps, op_steps = _steps(window.raw_pv), _steps(window.raw_op)
    moved = pv_steps[pv_steps > ROUNDING]
    return Limits(
        op_at_limit=float(max(low.mean(), high.mean())),
        pv_moves_at_limit=max(_moved_within(moves, low), _moved_within(moves, high)),
        pv_quantum=_quantum(moved),
        pv_least_step=float(np.log10(quantiles(moved, (0.05,))[0] + 1e-3)) if len(moved) else 0.0,
        pv_held=float(np.mean(pv_steps <= ROUNDING)),
        op_held=float(np.mean(op_steps <= ROUNDING)),
    )


def _steps(x: FloatArray) -> FloatArray:
    """Steps between samples in standard deviations of x less its straight line; zeros where that leaves rounding."""
    steps, spread = np.abs(np.diff(x)), float(deviation(without_line(x)))
    return steps / spread if spread > ROUNDING * float(np.ptp(x)) else np.zeros_like(steps)


def _at_extremes(op: FloatArray) -> tuple[BoolArray, BoolArray]:
    return at_ends(op, op.min(), op.max(), 5e-3 * float(np.ptp(op)))


def _movement(pv: FloatArray) -> FloatArray:
    smooth = moving_average(pv, 2)
    step = PER_CYCLE // 10
    return np.abs(smooth[step:] - smooth[:-step])


def _moved_within(moves: FloatArray, there: BoolArray) -> float:
    step = len(there) - len(moves)
    total = float(moves.sum())
    return float(moves[there[step:] & there[:-step]].sum()) / total if total > 0.0 else 0.0


def _quantum(steps: FloatArray) -> float:
    if len(steps) < _FEWEST_STEPS:
        return 0.0
    multiple = steps / steps.min()
    whole = np.abs(multiple - np.round(multiple)) < _SAME_STEP
    return float(steps.min()) if float(whole.mean()) > 0.95 else 0.0
