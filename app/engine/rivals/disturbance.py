"""The loop is disturbed from outside: by a wave, or by a load that wanders or jumps."""

from dataclasses import replace

import numpy as np

from app.engine.evidence import rising
from app.engine.rivals.jumps import Jumps, jumps
from app.engine.rivals.rival import Rival
from app.engine.rivals.scene import Scene

_STRONG_SWING = 0.6
WAVE = 0.7
"""Share of PV and OP, on cycles not fitted, that a wave from outside must explain."""
OPPOSED = 0.65
"""Opposition of OP and PV from which on the loop itself may be at its limit of stability."""
SLOWER, _TOO_QUICK = OPPOSED - 0.1, OPPOSED + 0.05
"""Opposition up to which the controller has time to integrate; and from where on it surely has not."""
UNEXPLAINED = 0.3
IN_LINE = 0.5
"""How much OP runs in line with PV from where on it answers it."""
TAKEN_BACK = 0.5
"""From where on jumps of PV that go back along with OP are the load's."""
_AGAINST_JUMPS = 3.0


def outside_wave(scene: Scene) -> Rival:
    """A wave with a constant phase runs through both PV and OP, slower than the loop would swing by itself.

    Stiction may keep its phase too, but its corners do not fit one sine. A loop at its limit of stability swings with
    OP against PV; here the controller has time to integrate. Misleads on a smooth limit cycle of an integrating process
    (deadband on a level), which looks like a sine.
    """
    in_line = _in_line(scene) if scene.oscillation.regular and scene.oscillation.strength > _STRONG_SWING else 0.0
    wave, opposition = scene.wave, scene.opposition
    in_phase, slower = rising(wave, 2 * WAVE - 1.0, 1.0), rising(opposition, _TOO_QUICK, 2 * SLOWER - _TOO_QUICK)
    found = Rival("external_oscillation", min(in_phase, slower), "", explained=wave)
    if in_line > found.strength:
        text = f"a regular oscillation, and {_answers(in_line)}"
        return replace(found, strength=in_line, text=text, statistic=in_line, threshold=IN_LINE)
    text = (
        f"a sine of constant phase explains {100 * wave:.0f} % of PV and OP on unseen cycles, and OP opposes PV "
        f"by {opposition:.2f}: an oscillation from outside leaves the controller time to integrate"
    )
    if slower < in_phase:
        return replace(found, text=text, statistic=opposition, operator="<=", threshold=SLOWER)
    return replace(found, text=text, statistic=wave, threshold=WAVE)


def load_disturbance(scene: Scene) -> Rival:
    """PV is disturbed from outside: OP answers PV in line, or PV does not follow from OP through any valve, or PV jumps
    and OP takes the jump back.

    Misleads if OP has little to do with PV for other reasons: a wrong pairing of signals, a loop in manual. Jumps are
    ignored if PV follows a set point, which makes PV jump too.
    """
    if not scene.along_sp:
        seen = jumps(scene.features.windows)
        if seen.taken_back >= TAKEN_BACK:
            return _load_steps(seen)
    follows = scene.features.named("causal_sticky")
    unexplained = rising(follows, 2 * UNEXPLAINED - 0.1, 0.1)
    in_line = _in_line(scene)
    if in_line > unexplained:
        return Rival("disturbance", in_line, _answers(in_line), statistic=in_line, threshold=IN_LINE)
    text = f"even on the data it was fitted to, a sticky valve explains {100 * follows:.0f} % of PV from OP"
    return Rival("disturbance", unexplained, text, statistic=follows, operator="<=", threshold=UNEXPLAINED)


def _answers(in_line: float) -> str:
    return f"OP is in phase or antiphase with PV by {in_line:.2f}, as when a controller answers a disturbance"


def _load_steps(seen: Jumps) -> Rival:
    text = (
        f"{100 * seen.jumping:.0f} % of PV's movement falls into a tenth of the time, and OP explains "
        f"{100 * seen.along:.0f} % of the rest: the load steps and the controller compensates; with a stuck valve PV "
        "would stand still"
    )
    strength = rising(seen.taken_back, 2 * TAKEN_BACK - 1.0, 1.0)
    return Rival("disturbance", strength, text, _AGAINST_JUMPS, statistic=seen.taken_back, threshold=TAKEN_BACK)


def no_oscillation(scene: Scene) -> Rival:
    """Nothing swings: what moves is noise or a slow load. Misleads below about three cycles in the record."""
    oscillation = scene.oscillation
    strength = 0.7 - oscillation.strength if not oscillation.regular else 0.4 - oscillation.strength
    text = f"the oscillation has strength {oscillation.strength:.2f} and regularity {oscillation.regularity:.2f}"
    return Rival(
        "no_oscillation",
        float(np.clip(strength, 0.0, 1.0)),
        text,
        statistic=oscillation.strength,
        operator="<=",
        threshold=0.2,
    )


def _in_line(scene: Scene) -> float:
    """How much OP runs in line with PV and not in quadrature; halved where stiction explains PV better."""
    in_line = scene.features.named("ccf_even") - scene.features.named("ccf_odd")
    return float(np.clip(in_line, 0.0, 1.0)) * (0.5 if scene.features.named("gain") > 0.3 else 1.0)
