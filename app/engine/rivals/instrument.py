"""Limits of actuator and instrument: OP that saturates, PV that knows only a few values."""

from app.engine.features import Features
from app.engine.rivals.rival import Rival

# Fixed beforehand, not fitted: a loop that cycles against a limit, or on the last digit of its transmitter, needs no
# sticky valve to do so.
_AGAINST_SATURATED = 2.0
_AGAINST_QUANTISED = 1.0
_LIMIT_SHARE = 0.2
_MOVEMENT_SHARE = 0.12
_QUANTUM = 0.6


def saturated_op(features: Features) -> Rival:
    """OP stands at an extreme for long while PV goes on moving: the controller is out of range, the valve follows."""
    at_limit, moves = features.named("op_at_limit"), features.named("pv_moves_at_limit")
    strength = min(at_limit / (2 * _LIMIT_SHARE), moves / (2 * _MOVEMENT_SHARE), 1.0)
    text = (
        f"OP stands at one of its extremes for {100 * at_limit:.0f} % of the time, and {100 * moves:.0f} % of the "
        "movement of PV happens meanwhile"
    )
    return Rival("saturated_op", strength, text, _AGAINST_SATURATED)


def quantised_sensor(features: Features) -> Rival:
    """PV moves in steps nearly as large as its standard deviation: the loop cycles on the resolution of the sensor."""
    quantum = features.named("pv_quantum")
    text = f"the resolution of PV is {quantum:.2g} of its standard deviation"
    return Rival("quantised_sensor", min(quantum / (2 * _QUANTUM), 1.0), text, _AGAINST_QUANTISED)
