"""Which effects are believed: the best contender while it pays, and a second beside it."""

from dataclasses import dataclass

from app.engine.mismatch.compete.competition import Contender, Scanned, survey
from app.engine.mismatch.compete.limits import LIMITS_OF_PV
from app.engine.mismatch.compete.looking_ahead import looked_ahead
from app.engine.mismatch.compete.naming import Believed, believed
from app.engine.mismatch.compete.pairing import coupled, couples
from app.engine.mismatch.compete.pairs import (
    Pair,
    Places,
    chosen,
    first_of,
    pairs_of,
    paying_alone,
    with_contenders,
)
from app.engine.mismatch.compete.ranking import best_of_each_code, by_worth, ranked
from app.engine.mismatch.compete.restarting import with_stems_shown
from app.engine.mismatch.compete.richer_noise import noise_takes
from app.engine.mismatch.compete.searching import searched
from app.engine.mismatch.compete.worth import (
    LEAST_OF_PENALTY,
    SECOND_MUST_GAIN,
    makes_sense,
    nearer,
    worth,
)
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.free_run import free_run_error
from app.engine.mismatch.fit.refitting import CODE as PARAMETERS
from app.engine.mismatch.loop.block import Block
from app.engine.mismatch.physics import TWINS
from app.engine.mismatch.physics.generic import CODE as UNNAMED

_LEADERS = 3
_CARRIED = 3
_MOST_HIDDEN = 2
_ROUNDS = 2
LEAST_MARGIN = -2.9  # a probability of 0.05
# Codes of which one pair holds one only.
APART = (LIMITS_OF_PV, *(frozenset((code, *twins)) for code, twins in TWINS.items()))


@dataclass(frozen=True, eq=False)
class Selection:
    """The final fit, its effects in the order of their gain, and the first round's ranking (for evidence). alone: what
    would be said without the second of two effects, where its first pays alone.
    """

    fit: Fit
    effects: tuple[Believed, ...]
    ranking: tuple[Contender, ...]
    alone: "Selection | None" = None


def select(
    base: Fit, blocks: tuple[Block, ...], already: tuple[str, ...] = (), stems: tuple[Contender, ...] = ()
) -> Selection:
    """Up to two effects beside the linear refit; none where no contender pays its penalty.

    `already`: codes that PV showed by itself, which are not looked for again. `stems`: that the record shows, each
    beside a loop of its own.
    """
    offered = tuple(block for block in blocks if block.code not in already)
    surveyed = survey(base, offered)
    first = with_stems_shown(_deepened(ranked(base, offered, surveyed=surveyed), offered), stems)
    asked = SECOND_MUST_GAIN if already else 0.0
    names = best_of_each_code(first)
    pays = bool(first) and worth(first[0]) > asked
    single = Selection(first[0].fit, (believed(first[0], names),), first) if pays else Selection(base, (), first)
    if pays and first[0].block.code == PARAMETERS:
        return single  # what is missing is looked for again beside the right ones
    begun = _leaders(first) if pays else _hidden(names)
    beside = {contender.block.name: _seconds(contender, names, offered) for contender in begun}
    pairs = [pair for places in beside.values() for pair in places.pairs(names)]
    pairs += found_together(base, surveyed, first, pays)
    if not pairs:
        return single
    # Beside either of a pair the other may turn out to have another name, and beside that other the first again.
    for place in (0, 1) * _ROUNDS:
        pair = chosen(pairs)
        name = pair.blocks[place].name
        if name not in beside:
            beside[name] = _seconds(pair.alone(place, base), names, offered)
            pairs += beside[name].pairs(names)
    best = with_contenders(chosen(pairs), beside)
    alone = paying_alone(best, base, first, offered)
    if alone is not None:
        return in_place_of(single, alone) if pays else single
    effects = (first_of(best, beside.get(best.second.block.name)), believed(best.second, best.names))
    ordered = tuple(sorted(effects, key=lambda effect: -effect.gain))
    both = Selection(best.second.fit, ordered, names, single if pays else None)
    return both if stands(both) and not noise_takes(both.fit, single.fit) else single


def _deepened(ranking: tuple[Contender, ...], blocks: tuple[Block, ...]) -> tuple[Contender, ...]:
    """A ranking in which the names that others are looked for beside stand as well as they can: beside one in a poor
    optimum anything pays that leads to a better.
    """
    deeper = {contender: searched(contender, blocks) for contender in _leaders(ranking)}
    return by_worth(tuple(deeper.get(contender, contender) for contender in ranking))


def in_place_of(single: Selection, alone: Contender) -> Selection:
    """What is said where one of a refused pair pays alone: that one, where it is worth at least what the best `single`
    effect is, which paid; that effect otherwise.
    """
    lone = Selection(alone.fit, (believed(alone, best_of_each_code(single.ranking)),), single.ranking)
    return lone if worth(alone) >= worth(single.ranking[0]) and stands(lone) else single


def stands(selection: Selection) -> bool:
    """Whether no effect is named where another name, not said with it, is clearly better in its place."""
    return all(effect.margin > LEAST_MARGIN for effect in selection.effects)


def found_together(base: Fit, surveyed: tuple[Scanned, ...], ranking: tuple[Contender, ...], pays: bool) -> list[Pair]:
    """Pairs that were looked for as such; where no single effect pays only those that run much nearer to PV."""
    single = max((contender.fit for contender in ranking), key=lambda fit: fit.score, default=base) if pays else base
    named = tuple(scanned for scanned in surveyed if scanned.block.code != UNNAMED)
    promising = couples(base, named, APART)
    found = (*coupled(base, promising, single), *looked_ahead(base, named, promising, ranking, APART))
    return [pair for both in found if pays or nearer(both, base) for pair in pairs_of(both, base, ranking)]


def _hidden(names: tuple[Contender, ...]) -> tuple[Contender, ...]:
    """Names that do not pay alone but bring the free run much nearer to PV: one of two effects that the noise hides as
    long as the other is missing.
    """
    gaining = [r for r in names if r.gain > LEAST_OF_PENALTY * r.block.penalty and makes_sense(r)]
    return tuple([r for r in gaining if nearer(r.fit, r.over)][:_MOST_HIDDEN])


def _leaders(ranking: tuple[Contender, ...]) -> tuple[Contender, ...]:
    """The first names that a second effect is looked for beside: the best, those close to it, and one that pays and
    runs much nearer to PV, whatever the other takes of the noise. None that stands for two effects already.
    """
    names = best_of_each_code(tuple(contender for contender in ranking if not contender.block.brings))
    if not names:
        return ()
    twins = TWINS.get(names[0].block.code, ())
    others = [r for r in names[1:] if worth(r) > 0.0 and r.block.code not in twins]
    close = [r for r in others if worth(r) > 0.5 * worth(names[0])]
    near = sorted((r for r in others if nearer(r.fit, names[0].fit)), key=lambda r: free_run_error(r.fit))
    return tuple(dict.fromkeys((names[0], *near[:1], *close)))[:_LEADERS]


def _seconds(contender: Contender, alone: tuple[Contender, ...], blocks: tuple[Block, ...]) -> Places:
    """What competes for the place beside a contender; names that did well alone begin from their values there too."""
    named = {contender.block.code, *TWINS.get(contender.block.code, ())}
    if contender.block.code in LIMITS_OF_PV:
        named |= LIMITS_OF_PV
    carried = tuple(r.fit.parts[-1] for r in alone if r.block.code not in named and worth(r) > 0.0)[:_CARRIED]
    return Places(
        contender, ranked(contender.fit, tuple(block for block in blocks if block.code not in named), carried)
    )
