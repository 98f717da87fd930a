"""Yamashita's movement patterns: OP rises or falls while PV stands, and then PV follows."""

import numpy as np

from app.engine.corroborate.case import Case
from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features.window import PER_CYCLE
from app.engine.signals.movement_patterns import rho_3

METHOD = Method(
    "movement_patterns",
    threshold=0.25,
    source="Yamashita 2006, Control Engineering Practice 14, 503-510",
)
_STRIDE = PER_CYCLE // 20


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
    return METHOD.answer(
        float(np.mean(shares)), f"share of the time in which PV stands still while OP moves{case.assumed}"
    )
