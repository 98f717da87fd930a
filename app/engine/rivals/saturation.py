"""OP is out of range: the controller stands at a limit while PV goes on moving."""

from app.engine.codes import Cause
from app.engine.rivals.rival import Rival
from app.engine.rivals.scene import Scene

SATURATED: Cause = "saturated_op"

# Fixed beforehand, not fitted: a loop that cycles against a limit needs no sticky valve to do so.
_AGAINST_STICTION = 2.0
LIMIT_SHARE = 0.2
MOVEMENT_SHARE = 0.12


def saturated_op(scene: Scene) -> Rival:
    """OP stands at an extreme for a long time while PV goes on moving: the controller is out of range, and the valve
    follows.

    Misleads if OP rests at its extreme between rare moves, and if the historian held OP's last value.
    """
    at_limit, moves = scene.features.named("op_at_limit"), scene.features.named("pv_moves_at_limit")
    strength = min(at_limit / (2 * LIMIT_SHARE), moves / (2 * MOVEMENT_SHARE), 1.0)
    text = (
        f"OP is at one of its extremes for {100 * at_limit:.0f} % of the time, during which {100 * moves:.0f} % of "
        "PV's movement happens"
    )
    return Rival(SATURATED, strength, text, _AGAINST_STICTION, statistic=at_limit, threshold=LIMIT_SHARE)
