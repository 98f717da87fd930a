"""He's curve fitting: the signal behind the integrator is a triangle under stiction, a sine otherwise."""

from app.engine.corroborate.corroboration import Corroboration, Method
from app.engine.features import Features
from app.engine.oscillation import Oscillation

METHOD = Method("curve_fitting", "10.1021/ie061219a", sticky_from=0.6, healthy_to=0.4)


def he_curve(features: Features, oscillation: Oscillation, integrating: bool | None) -> Corroboration:
    """Triangle against sine on OP, or on PV where the process integrates; for a loop that oscillates regularly."""
    if not oscillation.regular:
        return METHOD.refuse("the loop does not oscillate regularly")
    signal = "pv" if integrating else "op"
    return METHOD.answer(features.named(f"{signal}_triangle"), f"triangle against sine on {signal.upper()}")
