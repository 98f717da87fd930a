"""Whether any name is right: what the names leave beside what they explain, and what terms without a name explain in
their place. The margin of a name says how far the next one is behind; this, whether the library holds what is there.
"""

from dataclasses import replace

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.naming import Believed
from app.engine.mismatch.compete.selection import Selection
from app.engine.mismatch.compete.worth import no_worse
from app.engine.mismatch.fit.fitting import Fit, fit
from app.engine.mismatch.fit.scan import task_with
from app.engine.mismatch.fit.task import start_at
from app.engine.mismatch.judge.adequacy import Pays, lack_of_fit
from app.engine.mismatch.judge.conclude import nothing_left, too_few
from app.engine.mismatch.judge.holdout import FreeRuns, mostly_worse, refit_without, stretches, unseen_gain
from app.engine.mismatch.physics.generic import CODE as UNNAMED
from app.engine.mismatch.physics.terms import made_of

_CLEARLY = 20.0  # nat: by how much terms without a name must say more than names do, to take their place
_NOT_FAR = 0.5
_LITTLE = 0.05  # a share that says nothing against a name
# The share left beside a name at which it is as likely wrong as right. A linear loop of our own is a guess from the
# same record and leaves something itself: real valves that stick are named rightly with shares up to 0.5.
HALF_SURE, HALF_SURE_OWN = 0.1, 0.4


def reviewed(base: Fit, selection: Selection) -> Selection:
    """A selection whose names are less sure for what they leave unexplained; something unnamed in their place where
    terms without a name clearly say more than they do. As it is where nothing pays beside it.
    """
    if too_few(base.record) or nothing_left(selection.fit):
        return selection
    left = lack_of_fit(selection.fit)
    if not left:
        return selection
    # A linear loop of our own is a guess from the same record: terms would mend that as well.
    own = base.given.own
    unnamed = None if own else without_name(base, lack_of_fit(base) if selection.effects else left)
    if (
        unnamed is not None
        and _says_more(unnamed.fit, selection.fit, base)
        and not runs_astray(selection.fit, unnamed.fit)
    ):
        named = max(_named_score(base, selection), 0.0)
        return Selection(unnamed.fit, (_in_place_of(selection, unnamed, named),), selection.ranking)
    half_sure = HALF_SURE_OWN if own else HALF_SURE
    return replace(selection, effects=tuple(doubted(effect, left, half_sure) for effect in selection.effects))


def runs_astray(names: Fit, unnamed: Fit) -> bool:
    """Whether terms without a name, which bend with whatever is there, run worse than the names do over most of the
    stretches that neither has seen.
    """
    pv, runs = names.record.pv_deviation, []
    for held in stretches(names.record.usable):
        before, after = refit_without(names, held), refit_without(unnamed, held)
        gain = unseen_gain(before, after, held)
        runs.append(FreeRuns(before.simulated, after.simulated, held, gain, after, ()))
    return mostly_worse(pv, runs)


def _says_more(unnamed: Fit, names: Fit, base: Fit) -> bool:
    """Whether terms without a name clearly say more than names do, or than the linear refit where these say less;
    under a richer noise too, because terms that answer OP take what the noise model lacks.
    """
    richer = [fit.beside_richer_noise for fit in (unnamed, names, base)]
    return all(terms.score > max(n.score, b.score) + _CLEARLY for terms, n, b in ((unnamed, names, base), richer))


def _named_score(base: Fit, selection: Selection) -> float:
    """What the names explain beyond their penalties (nat)."""
    return selection.fit.score - base.score


def without_name(base: Fit, terms: tuple[Pays, ...]) -> Contender | None:
    """The terms that pay beside the linear refit, fitted as one generic block; None where none does."""
    if not terms:
        return None
    block = made_of(tuple(term.name for term in terms))
    task = task_with(base, block)
    known = [part.values for part in base.parts]
    x = start_at(task, base.plant, np.concatenate((*known, np.zeros(len(terms)))))
    found = fit(task, x, base.noise, 3, 6)
    return Contender(found, base) if no_worse(found, base) else None


def _in_place_of(selection: Selection, unnamed: Contender, named: float) -> Believed:
    """Something unnamed, with the name that came nearest: as an alternative where it is not far behind."""
    margin = unnamed.score - named
    nearest = next((effect.code for effect in selection.effects if effect.code != UNNAMED), None)
    if nearest is None:
        return Believed(UNNAMED, (), unnamed.gain, margin, unnamed)
    text = (
        f"the closest named candidates, {nearest} first, are {margin:.1f} points of log-likelihood behind unnamed terms"
    )
    alternatives = (nearest,) if named > _NOT_FAR * unnamed.score else ()
    return Believed(UNNAMED, alternatives, unnamed.gain, margin, unnamed, left=(Reason("nearest_name", text),))


def doubted(effect: Believed, left: tuple[Pays, ...], half_sure: float) -> Believed:
    """An effect whose probability is the lower the more further terms explain beside it; what says no name is right
    stays as sure.
    """
    if effect.code == UNNAMED:
        return effect
    gain = sum(term.gain for term in left)
    share = gain / (gain + max(effect.gain, 1e-9))
    names = ", ".join(term.name for term in left)
    text = f"unnamed terms ({names}) add {gain:.1f} points to it, {100.0 * share:.0f} % of what both add"
    text += ": the physics may be different" if share > _LITTLE else ""
    return replace(effect, most=1.0 / (1.0 + (share / half_sure) ** 2), left=(Reason("lack_of_fit", text),))
