"""Yamashita's movement patterns, reduced to their core: PV still while OP moves."""

from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features import Features

METHOD = Method("movement_patterns", "10.1016/j.conengprac.2005.03.004", sticky_from=0.35, healthy_to=0.25)


def still_pv(features: Features, integrating: bool | None) -> Corroboration:
    """Share of the OP travel that finds PV standing still; for fast self-regulating processes such as flows."""
    if integrating:
        return METHOD.refuse("PV of an integrating process moves while the valve stands")
    return METHOD.answer(features.named("flat_eighth"), "share of the travel of OP that finds PV still")
