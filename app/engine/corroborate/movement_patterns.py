"""Yamashita's movement patterns: OP rises or falls while PV stands, and then PV follows."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.engine.corroborate.case import Case
from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features.window import PER_CYCLE
from app.engine.recording import FloatArray

METHOD = Method(
    "movement_patterns",
    threshold=0.25,
    source="Yamashita 2006, Control Engineering Practice 14, 503-510",
)
_STRIDE = PER_CYCLE // 20
_MOVES_FROM = 1.0


def movement_patterns(case: Case) -> Corroboration:
    """rho_3: share of the time in which OP moves and PV stands, less where PV's next move does not fit stiction.

    Every step of OP and PV is I (rises), D (falls) or S (stands); steps in which both stand do not count. rho_1 is the
    share of IS and DS (OP moves, PV stands). Of these, rho_3 keeps the periods that end with PV following OP: IS before
    II or SI, DS before DD or SD. Above 0.25 stiction, else not. For self-regulating processes that are fast against
    the oscillation (flows), where PV shows the valve's position. The source leaves the sampling and the size of a move
    open: twenty steps a cycle here, of PV and OP smoothed over about an eighth of it, and one standard deviation of the
    steps. The sign of the process gain being free, the better of both is taken. Misleads on slow processes, in which
    PV lags OP anyhow.
    """
    if case.why_not_self_regulating:
        return METHOD.refuse(case.why_not_self_regulating)
    shares = [rho_3(window.op_smooth[::_STRIDE], window.pv_smooth[::_STRIDE]) for window in case.windows]
    return METHOD.answer(float(np.mean(shares)), f"share of the time in which PV stands while OP moves{case.assumed}")


def rho_3(op: FloatArray, pv: FloatArray) -> float:
    """rho_3 of OP and PV (n,), for the sign of the gain that gives more."""
    op_moves, pv_moves = _moves(op), _moves(pv)
    counted = int(np.count_nonzero((op_moves != 0) | (pv_moves != 0)))
    if counted == 0:
        return 0.0
    return max(_followed(op_moves, pv_moves), _followed(op_moves, -pv_moves)) / counted


def _moves(x: FloatArray) -> NDArray[np.int8]:
    """1, 0 or -1 for each step of x: rises, stands, falls."""
    steps = np.diff(x)
    scaled = (steps - steps.mean()) / (float(np.std(steps)) or 1.0)
    return np.where(np.abs(scaled) > _MOVES_FROM, np.sign(scaled), 0.0).astype(np.int8)


@njit(cache=True, nogil=True)
def _followed(op: NDArray[np.int8], pv: NDArray[np.int8]) -> int:
    """Steps in sticking periods (OP moves one way, PV stands) after which PV moves that way and OP not against it."""
    total = length = 0
    way = 0
    for i in range(len(op)):
        if op[i] != 0 and pv[i] == 0 and (length == 0 or op[i] == way):
            way = op[i]
            length += 1
            continue
        if op[i] == 0 and pv[i] == 0:
            continue
        if length > 0 and pv[i] == way and op[i] != -way:
            total += length
        length = 0
        if op[i] != 0 and pv[i] == 0:
            way, length = op[i], 1
    return total
