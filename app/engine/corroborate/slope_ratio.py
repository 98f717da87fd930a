"""Damarla's linear regression: OP runs while PV stands, seen from the slopes of straight lines piece by piece."""

import numpy as np

from app.engine.corroborate.case import Case
from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features import ShapeWindow
from app.engine.features.window import PER_CYCLE
from app.engine.recording import FloatArray
from app.engine.signals.sampled import ROUNDING

METHOD = Method(
    "slope_ratio",
    threshold=0.1,
    source="Damarla, Sun, Xu, Shah, Amalraj, Huang 2022, Ind. Eng. Chem. Res. 61, 502-514",
)
_PIECE = PER_CYCLE // 8
_RATIO = 15.0


def slope_ratio(case: Case) -> Corroboration:
    """Share of the pieces in which the slope of OP is 15 times that of PV or more (both at unit deviation).

    For self-regulating processes that oscillate regularly. Pieces of an eighth of a cycle. Length and ratio (6 samples,
    15) are those of a public implementation of the paper, which leaves them to the user. It calls a valve sticky where
    any piece is; but two sines in quadrature have 4 % of such pieces, at the peaks of PV, so 10 % are asked for here.
    Misleads on processes that are slow against the oscillation.
    """
    if case.why_not_self_regulating:
        return METHOD.refuse(case.why_not_self_regulating)
    shares = [_share(window) for window in case.windows]
    return METHOD.answer(
        float(np.mean(shares)), f"share of the time in which OP ramps and PV stands still{case.assumed}"
    )


def _share(window: ShapeWindow) -> float:
    op, pv = _slopes(window.op), _slopes(window.pv)
    return float(np.mean((op > ROUNDING) & (op >= _RATIO * pv)))


def _slopes(x: FloatArray) -> FloatArray:
    """Absolute slopes of the straight lines through the pieces of x, a sample."""
    pieces = x[: len(x) // _PIECE * _PIECE].reshape(-1, _PIECE)
    t = np.arange(_PIECE) - (_PIECE - 1) / 2
    return np.abs(pieces @ t) / (t @ t)
