"""PV and OP follow a set point that moves."""

from app.engine.evidence import rising
from app.engine.rivals.rival import Rival, not_evaluated
from app.engine.rivals.scene import Scene
from app.engine.signals.sampled import correlation

_FOLLOWED = 0.7
_NOTHING = 0.4
ALONG = 0.5
"""The product of the shares of PV and of OP that go along with the set point as it is, from where on they follow it."""
BEHIND_ALL = 0.85
"""Strength from which on the set point is behind all that PV and OP do."""
_STICTION_EXPLAINS = 0.005
_AGAINST_STICTION = 1.0


def set_point_following(scene: Scene) -> Rival:
    """PV and OP both follow from the set point through a lag and a dead time, on cycles that the fit has not seen.

    Not evaluated if the set point is unknown or constant. Misleads in a sticky inner loop of a cascade, whose set point
    is moved by the loop around it at the same period. It therefore counts against stiction only if the set point is
    behind all that PV and OP do, and a sticky valve explains less than half a per cent more of PV's variance from OP
    than one that follows OP.
    """
    if not scene.sp:
        return not_evaluated("set_point_following", "the set point does not move or is not known")
    pv, op = scene.from_sp
    plainly = 0.0 if scene.record.sp is None else scene.pv_along_sp * correlation(scene.record.op, scene.record.sp) ** 2
    later = rising(min(pv, op), _NOTHING, 2 * _FOLLOWED - _NOTHING)
    strength = max(later, plainly)
    if plainly > later:
        text, statistic, threshold = f"PV and OP follow the set point directly, by {plainly:.2f}", plainly, ALONG
    else:
        text = (
            f"the set point explains PV ({100 * pv:.0f} % of its variance on unseen cycles) and OP ({100 * op:.0f} %)"
        )
        statistic, threshold = min(pv, op), _FOLLOWED
    plain = strength >= BEHIND_ALL and scene.features.named("misfit_drop") < _STICTION_EXPLAINS
    if plain:
        text += "; a sticky valve explains PV from OP no better than a linear one"
    counts = _AGAINST_STICTION if plain else 0.0
    return Rival("set_point_following", strength, text, counts, statistic=statistic, threshold=threshold, explained=pv)
