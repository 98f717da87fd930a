"""The controller makes the loop swing, or lets it drift."""

from app.engine.evidence import rising
from app.engine.rivals.disturbance import OPPOSED, WAVE
from app.engine.rivals.line import Line
from app.engine.rivals.rival import Rival, not_evaluated
from app.engine.rivals.scene import Scene

_PURE_SINE = 0.8
_SINE_FORM = 0.2
_STICTION_EXPLAINS = 0.1
_AGAINST_SINES = 3.0
# Share of the power about a fundamental that is in its line, from which on a signal is a steady wave.
_STEADY = 0.97
_MOST_THIRD, _LOUDEST = 0.07, 3.0
_FROM_SP = 0.1
RINGING = 0.5
"""Decay ratio from which on Miao and Seborg call a loop excessively oscillatory."""
FOLLOWS_OP = 0.35
"""Share of PV that a linear process must explain from OP: a loop that rings is moved by its own controller."""
IDLE = 0.2
_FEWEST_CYCLES = 6.0
_AGAINST_SLUGGISH = 1.0
_RINGS = 0.25


def pure_sines(scene: Scene) -> Rival:
    """Both signals are pure sines that do not die out: a linear loop at the limit of stability, or disturbed by a sine.

    One frequency alone cannot tell the two apart: in both cases PV over OP is minus one over the controller. A stuck
    stem makes corners, and its limit cycle is not quite steady. If PV and OP are lines of the spectrum without
    harmonics, the noise beside them does not matter. A wave that comes from the set point is not examined in this way.
    """
    narrow = None if scene.from_sp[0] >= _FROM_SP else scene.line
    if narrow is not None and _is_sine(narrow):
        return _one_line(narrow)
    features = scene.features
    purity = min(features.named("pv_fundamental"), features.named("op_fundamental"))
    strength = scene.oscillation.strength * rising(purity, _PURE_SINE, 1.0)
    text = f"{100 * purity:.0f} % of the power of PV and OP is in the fundamental, as in pure sines"
    # A stuck stem leaves corners in one of the two: half cycles of both that fit a sine are no work of a valve.
    sines = max(features.named("pv_triangle"), features.named("op_triangle")) < _SINE_FORM
    if not sines and features.named("gain") >= _STICTION_EXPLAINS:
        strength *= 0.5
    counts = _AGAINST_SINES if sines else 0.0
    return Rival("tuning_or_sinusoidal_disturbance", strength, text, counts, statistic=purity, threshold=0.9)


def _is_sine(narrow: Line) -> bool:
    return narrow.share >= _STEADY and narrow.third <= _MOST_THIRD and narrow.loudest <= _LOUDEST


def _one_line(narrow: Line) -> Rival:
    text = (
        f"PV and OP oscillate with {100 * narrow.share:.0f} % of their power in one line of the spectrum, without "
        f"harmonics: the third is at most {100 * narrow.third:.0f} % of the fundamental (a triangle has 11 %, a square "
        "33 %)"
    )
    strength = rising(narrow.share, 2 * _STEADY - 1.0, 1.0)
    return Rival(
        "tuning_or_sinusoidal_disturbance", strength, text, _AGAINST_SINES, statistic=narrow.share, threshold=_STEADY
    )


def tight_tuning(scene: Scene) -> Rival:
    """An undamped sine with OP against PV: a linear loop at the limit of stability.

    At that limit an ordinary controller hardly integrates, so OP turns where PV turns. Fit: PV from OP through a linear
    process with the sign of a closed loop. Misleads if a sine from outside is as fast as the loop itself.
    """
    if scene.oscillation.cycles < _FEWEST_CYCLES:
        return not_evaluated(
            "tight_tuning", f"{scene.oscillation.cycles:.1f} cycles cannot show that the oscillation does not decay"
        )
    undamped = min(rising(scene.wave, 2 * WAVE - 1.0, 1.0), rising(scene.opposition, OPPOSED - 0.15, OPPOSED + 0.15))
    text = (
        f"a sine of constant phase explains {100 * scene.wave:.0f} % of PV and OP on unseen cycles, and OP opposes PV "
        f"by {scene.opposition:.2f}; near 1 that is a loop at its stability limit, or a sine just as fast"
    )
    held = scene.features.named("held_linear")
    return Rival("tight_tuning", undamped, text, statistic=scene.opposition, threshold=OPPOSED, explained=held)


def aggressive_controller(scene: Scene) -> Rival:
    """PV rings after every upset, with OP against PV, and the ringing dies out: the controller is too strong.

    Decay ratio of the autocorrelation of PV after Miao and Seborg 1999, IEEE Conference on Control Applications,
    359-364. Misleads if the load itself swings in a narrow band.
    """
    if scene.oscillation.cycles < _FEWEST_CYCLES:
        return not_evaluated("aggressive_controller", f"{scene.oscillation.cycles:.1f} cycles cannot show a decay")
    strength = min(
        rising(scene.decay_ratio, RINGING - 0.2, RINGING + 0.2),
        rising(scene.opposition, OPPOSED - 0.15, OPPOSED + 0.15),
        rising(scene.features.named("causal_linear"), FOLLOWS_OP - 0.15, FOLLOWS_OP + 0.15),
    )
    text = f"PV oscillates with a decay ratio of {scene.decay_ratio:.2f}, and OP opposes it by {scene.opposition:.2f}"
    held = scene.features.named("held_linear")
    return Rival(
        "aggressive_controller", strength, text, statistic=scene.decay_ratio, threshold=RINGING, explained=held
    )


def sluggish_controller(scene: Scene) -> Rival:
    """After an upset PV comes back with OP, slowly and without ringing: the controller is too weak.

    Haegglund's idle index (2005, Control Engineering Practice 13, 1383-1390; 1999, same journal 7, 1505-1511): share of
    the steps in which OP and PV move the same way, by the sign of the process, less the share of the others. Not
    evaluated if the loop rings, because the index is meant for single upsets. Misleads if the set point moves in steps.
    """
    if scene.decay_ratio > _RINGS:
        return not_evaluated("sluggish_controller", f"PV oscillates (decay ratio {scene.decay_ratio:.2f})")
    idle = -scene.opposition
    text = f"PV does not ring, and moves with OP (idle index {idle:.2f})"
    held = scene.features.named("held_linear")
    strength = rising(idle, 0.0, 2 * IDLE)
    return Rival(
        "sluggish_controller", strength, text, _AGAINST_SLUGGISH, statistic=idle, threshold=IDLE, explained=held
    )
