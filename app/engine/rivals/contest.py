"""Stiction among its rivals: which explanation wins, and which comes second."""

from app.engine.codes import Cause
from app.engine.evidence import told_probability
from app.engine.features import Features
from app.engine.rivals.rival import Rival

STICTION: Cause = "stiction"
_HEARD = 0.25
_STANDS = 0.5


def contest(rivals: tuple[Rival, ...], probability: float, features: Features) -> tuple[Rival, ...]:
    """All explanations, ranked; the strength of stiction is its probability.

    rivals: ranked, as `compete` gives them. Those that count have already been taken off the probability, so a stiction
    above one half has won against them.
    """
    own = _stiction(probability, features)
    if own.stands_out:
        return (own, *rivals)
    standing = [rival for rival in rivals if rival.stands_out]
    others = [rival for rival in rivals if not rival.stands_out]
    return (*standing, *sorted((*others, own), key=lambda r: (not r.applies, -r.strength)))


def winner(ranked: tuple[Rival, ...]) -> Rival | None:
    """The first explanation, if it stands out."""
    return ranked[0] if ranked and ranked[0].stands_out else None


def runner_up(ranked: tuple[Rival, ...]) -> Rival | None:
    """The next one behind the winner, if anything speaks for it; None if there is no winner."""
    if winner(ranked) is None or len(ranked) < 2:
        return None
    return ranked[1] if ranked[1].strength >= _HEARD else None


def _stiction(probability: float, features: Features) -> Rival:
    held, linear = features.named("held_sticky"), features.named("held_linear")
    sticky_pct, linear_pct = 100 * max(held, 0.0), 100 * max(linear, 0.0)
    text = (
        f"probability {told_probability(probability)}; fitted on one half of each window and run freely on the other, "
        f"a sticky valve explains {sticky_pct:.0f} % of PV, a linear one {linear_pct:.0f} %"
    )
    if probability > _STANDS and sticky_pct <= linear_pct:
        text += ": the shapes of PV and OP point to stiction, not this fit"
    return Rival(
        STICTION,
        probability,
        text,
        statistic=probability,
        threshold=_STANDS,
        explained=held,
        explained_without_stiction=linear,
    )
