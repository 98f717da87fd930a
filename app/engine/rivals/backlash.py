"""Backlash: a pure deadband between OP and the stem, without the jump of a stem that sticks."""

import math

from app.engine.evidence import rising
from app.engine.rivals.response import response, valve_response
from app.engine.rivals.rival import Rival, not_evaluated
from app.engine.rivals.scene import Scene

_BANDS = (0.2, 0.4, 0.7)
_SLIPS = (0.5, 1.0)
_GAIN_WORTH_IT = 0.05
BETTER = 0.3
"""Logarithm of the ratio of misfits on unseen cycles from which on the deadband is taken for the better model."""
_MISFIT_FLOOR = 0.01
# On simulated valves the lead tells J = 0 from J > 0 too rarely: it is heard beside stiction, and names no cause.
_HEARD = 0.49


def backlash(scene: Scene) -> Rival:
    """A deadband (J = 0) explains PV on unseen cycles better than a linear valve and than one that slips (J > 0).

    The model is He's valve with J = 0, then a lag or integrator and a dead time, in the last window. Not evaluated if
    no valve model is better than a linear one. Backlash is a fault of the valve too, so it takes nothing from stiction.
    Misleads, and mostly finds nothing, on noisy records, in which J cannot be determined.
    """
    if scene.features.named("gain") < _GAIN_WORTH_IT:
        return not_evaluated("backlash", "no valve model explains PV better than a linear valve")
    pv, op = scene.pv[-1], scene.op_scaled[-1]
    linear = response(pv, op).held_out
    play = valve_response(pv, op, _BANDS, (0.0,)).held_out
    slip = valve_response(pv, op, _BANDS, _SLIPS).held_out
    lead = math.log((1.0 - max(linear, slip) + _MISFIT_FLOOR) / (1.0 - play + _MISFIT_FLOOR))
    text = (
        f"on unseen cycles of the last window a deadband without slip-jump explains {100 * play:.0f} % of PV, a "
        f"linear valve {100 * linear:.0f} %, one with slip-jump {100 * slip:.0f} %"
    )
    return Rival(
        "backlash", _HEARD * rising(lead, 0.0, 2 * BETTER), text, statistic=lead, threshold=BETTER, explained=play
    )
