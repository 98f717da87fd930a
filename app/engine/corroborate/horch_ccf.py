"""Horch's cross-correlation: odd for a sticky valve, even for a disturbance (self-regulating processes under PI)."""

from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features import Features
from app.engine.oscillation import Oscillation

METHOD = Method("cross_correlation", "10.1016/S0967-0661(99)00100-8", sticky_from=0.6, healthy_to=0.4)


def horch_ccf(features: Features, oscillation: Oscillation, integrating: bool | None) -> Corroboration:
    """Share of the odd part in the cross-correlation of OP and PV; for a regular loop that does not integrate."""
    if not oscillation.regular:
        return METHOD.refuse("the loop does not oscillate regularly")
    if integrating:
        return METHOD.refuse("in an integrating process disturbances are odd, too")
    return METHOD.answer(features.named("odd_share"), "odd share of the cross-correlation of OP and PV")
