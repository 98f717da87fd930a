"""Which effects are believed: the best rival while it pays, a second beside it, and what cannot be told from them."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.mismatch.block import Block, Part
from app.engine.mismatch.compete import Rival, Scanned, rivals, survey
from app.engine.mismatch.fitting import OWN_DEVIATION, Fit, by_free_run, fit, make_task, start_at
from app.engine.mismatch.kindred import with_kindred
from app.engine.mismatch.limits import limit_bonus
from app.engine.mismatch.pairing import alone_as, coupled, reordered
from app.engine.mismatch.physics import CLOSE, NEAR, NEAR_SHARE, TWINS
from app.engine.mismatch.refitting import CODE as PARAMETERS
from app.engine.mismatch.worth import (
    LEAST_OF_PENALTY,
    SECOND_MUST_GAIN,
    UNNAMED,
    free_run_error,
    gain_under,
    hidden_from,
    hidden_gain,
    makes_sense,
    nearer,
    no_worse,
    pays_beside,
    timed,
    worth,
    worth_beside,
)

LEADERS = 3
CARRIED = 3
MOST_HIDDEN = 2
INDISTINCT = 5.0
LEAST_MARGIN = -2.9  # a probability of 0.05
MOST_ALTERNATIVES = 2
SMALL_SLIP = 0.35
# One limit of PV is one effect, whichever of these it is called.
LIMITS = {"process.overflow", "sensor.saturation"}
# Codes of which one pair holds one only.
APART = (frozenset(LIMITS), *(frozenset((code, *twins)) for code, twins in TWINS.items()))
OWN_SHARE = 0.35
# What is no physics is no alternative to any: it only makes a name less sure.
UNSAID = (UNNAMED, PARAMETERS)


@dataclass(frozen=True, eq=False)
class Believed:
    """An effect that is believed. gain: log-likelihood (nat) over the fit without it; margin: over the best other
    name.
    """

    code: str
    alternatives: tuple[str, ...]
    gain: float
    margin: float
    rival: Rival


@dataclass(frozen=True, eq=False)
class Selection:
    """The final fit, its effects in the order of their gain, and the first round's ranking (for evidence). alone: what
    would be said without the second of two effects, where its first pays alone.
    """

    fit: Fit
    effects: tuple[Believed, ...]
    ranking: tuple[Rival, ...]
    alone: "Selection | None" = None


def ranked(
    found: Fit,
    blocks: tuple[Block, ...],
    carried: tuple[Part, ...] = (),
    surveyed: tuple[Scanned, ...] | None = None,
) -> tuple[Rival, ...]:
    competed = tuple(reconciled(rival) for rival in rivals(found, blocks, carried, surveyed))
    if not competed:
        return ()
    every = with_kindred(competed, max(competed, key=worth), blocks)
    return tuple(sorted(every, key=lambda rival: -worth(rival)))


def reconciled(rival: Rival) -> Rival:
    """A rival whose likelihood had gone with a worse free run, fitted again by its free run; as it was where that
    loses what it gained.
    """
    if no_worse(rival.fit, rival.over) or rival.score <= 0.0:
        return rival
    other = by_free_run(rival.fit)
    gain = other.likelihood - rival.over.likelihood
    better = no_worse(other, rival.over) and gain > rival.block.penalty
    return replace(rival, fit=other, gain=gain) if better else rival


def best_of_each_code(ranking: tuple[Rival, ...]) -> tuple[Rival, ...]:
    first: dict[str, Rival] = {}
    for rival in ranking:
        first.setdefault(rival.block.code, rival)
    return tuple(first.values())


def select(base: Fit, blocks: tuple[Block, ...], already: tuple[str, ...] = ()) -> Selection:
    """Up to two effects beside the linear refit; none where no rival pays its penalty.

    `already`: codes that PV showed by itself, which are not looked for again.
    """
    offered = tuple(block for block in blocks if block.code not in already)
    surveyed = survey(base, offered)
    first = ranked(base, offered, surveyed=surveyed)
    asked = SECOND_MUST_GAIN if already else 0.0
    names = best_of_each_code(first)
    pays = bool(first) and worth(first[0]) > asked
    single = Selection(first[0].fit, (believed(first[0], names),), first) if pays else Selection(base, (), first)
    begun = leaders(first) if pays else hidden(names)
    beside = {rival.block.name: seconds(rival, names, offered) for rival in begun}
    pairs = [pair for places in beside.values() for pair in places.pairs(names)]
    pairs += found_together(base, surveyed, first, pays)
    if not pairs:
        return single
    # Beside either of a pair the other may turn out to have another name.
    for beginning in (first_beside, second_beside):
        other = beginning(chosen(pairs), base)
        if other.block.name not in beside:
            places = beside[other.block.name] = seconds(other, names, offered)
            pairs += places.pairs(names)
    best = with_rivals(chosen(pairs), beside)
    alone = first_from_pair(best) or second_from_pair(best, base)
    if alone is not None:
        lone = Selection(alone.fit, (believed(alone, names),), first)
        return lone if pays and stands(lone) else single
    effects = (first_of(best, beside.get(best.second.block.name)), believed(best.second, best.names))
    ordered = tuple(sorted(effects, key=lambda effect: -effect.gain))
    both = Selection(best.second.fit, ordered, names, single if pays else None)
    return both if stands(both) else single


def stands(selection: Selection) -> bool:
    """Whether no effect is named where another name, not said with it, is clearly better in its place."""
    return all(effect.margin > LEAST_MARGIN for effect in selection.effects)


@dataclass(frozen=True, eq=False)
class Pair:
    """A second effect beside a first. first_gain: what the first gains beside the second (nat). names: all that
    competed for the second place.
    """

    first: Rival
    second: Rival
    first_gain: float
    names: tuple[Rival, ...]


@dataclass(frozen=True, eq=False)
class Places:
    """A first effect, and what competed for the place beside it, the best first."""

    first: Rival
    ranking: tuple[Rival, ...]

    def pairs(self, alone: tuple[Rival, ...]) -> tuple[Pair, ...]:
        """The best second effect, where each of the two is worth having beside the other; `alone`: single effects."""
        if not self.ranking:
            return ()
        best, beside = self.ranking[0], max(self.ranking, key=worth_beside)
        taken = (best,) if beside is best else (best, beside)
        return tuple(pair for second in taken for pair in self.pair_with(second, alone))

    def pair_with(self, best: Rival, alone: tuple[Rival, ...]) -> tuple[Pair, ...]:
        if not pays_beside(best, self.first):
            return ()
        rival = self.first
        other = max((r.fit.likelihood for r in alone if r.block.code == best.block.code), default=-np.inf)
        first_gain = best.fit.likelihood - max(other, rival.fit.likelihood - rival.gain)
        # What says least must explain most: by scores, not likelihoods.
        strongest = max((rival.over, *(r.fit for r in alone)), key=lambda fit: fit.score)
        if first_gain < rival.block.penalty + SECOND_MUST_GAIN or not over_single(best, strongest):
            return ()
        return (Pair(rival, best, first_gain, best_of_each_code(self.ranking)),)


def over_single(second: Rival, strongest: Fit) -> bool:
    """Whether a pair says more than the strongest single effect, with what the noise beside that hid of it."""
    gained = second.fit.score - strongest.score
    if gained >= SECOND_MUST_GAIN or hidden_gain(second) == 0.0:
        return gained >= SECOND_MUST_GAIN
    return gained + hidden_from(second.fit, strongest) >= SECOND_MUST_GAIN


def pairs_of(found: Fit, base: Fit, ranking: tuple[Rival, ...]) -> tuple[Pair, ...]:
    """A couple that was fitted together as a pair: the first is that which did better alone."""
    known = {rival.block.name: rival for rival in reversed(ranking)}
    alone = [known.get(part.block.name) or alone_as(part, base, found.plant) for part in found.parts[-2:]]
    order = (0, 1) if alone[0].fit.likelihood >= alone[1].fit.likelihood else (1, 0)
    first, both = alone[order[0]], reordered(found, order)
    second = reconciled(Rival(both.parts[-1].block, both, both.likelihood - first.fit.likelihood, first.fit))
    return Places(first, (second,)).pairs(best_of_each_code(ranking))


def first_from_pair(pair: Pair) -> Rival | None:
    """The first of a pair fitted alone from where the pair stands, if that leaves the second too little: what a better
    start of the first gains is nothing that the second explains.
    """
    first, found = pair.first, pair.second.fit
    task = make_task(found.record, found.given, tuple(part.block for part in first.fit.parts))
    known = [part.values for part in found.parts[: len(first.fit.parts)]]
    alone = fit(task, start_at(task, found.plant, np.concatenate(known)), found.noise, 2, 6)
    better = alone.likelihood - first.fit.likelihood
    if better <= 0.0:
        return None
    again = replace(first, fit=alone, gain=first.gain + better)
    second = reconciled(replace(pair.second, over=alone, gain=pair.second.gain - better))
    return None if pays_beside(second, again) else again


def second_from_pair(pair: Pair, base: Fit) -> Rival | None:
    """The second of a pair fitted alone from where the pair stands, if that leaves the first too little: a start that
    only the pair had is nothing that the first explains.
    """
    found = pair.second.fit
    alone = alone_as(found.parts[-1], base, found.plant)
    enough = found.likelihood - alone.fit.likelihood >= pair.first.block.penalty + SECOND_MUST_GAIN
    return None if enough or not makes_sense(alone) else alone


def together(pair: Pair) -> float:
    """A pair's score, with what the quiet of its limited stretches says."""
    return heard(pair.second.fit)


def heard(fit: Fit) -> float:
    """A fit's score, with what the quiet of its limited stretches says."""
    return fit.score + sum(limit_bonus(fit, part) for part in fit.parts)


def first_of(pair: Pair, beside_second: Places | None) -> Believed:
    """The first of a pair, with the names that come near it beside the second one."""
    names = () if beside_second is None else best_of_each_code(beside_second.ranking)
    again = next((r for r in names if r.block.code == pair.first.block.code), None)
    alone = Believed(
        pair.first.block.code,
        twins_of(pair.first),
        pair.first_gain,
        worth(pair.first) / own_doubt(pair.first),
        pair.first,
    )
    if again is None or beside_second is None:
        return alone
    # The pair may stand better than the same two found in the other order.
    standing = max(worth(again), together(pair) - heard(beside_second.first.fit))
    beside = believed(again, names, standing)
    return replace(alone, alternatives=beside.alternatives, margin=beside.margin)


def first_beside(pair: Pair, _: Fit) -> Rival:
    return pair.first


def second_beside(pair: Pair, base: Fit) -> Rival:
    """The effect of a pair that was found second, alone."""
    return alone_as(pair.second.fit.parts[-1], base, base.plant)


def with_rivals(pair: Pair, beside: dict[str, Places]) -> Pair:
    """A pair with all names that competed for its second place, where they were found without it as well."""
    places = beside.get(pair.first.block.name)
    if places is None or any(rival is pair.second for rival in places.ranking):
        return pair
    names = sorted((pair.second, *places.ranking), key=lambda rival: -worth(rival))
    return replace(pair, names=best_of_each_code(tuple(names)))


def found_together(base: Fit, surveyed: tuple[Scanned, ...], ranking: tuple[Rival, ...], pays: bool) -> list[Pair]:
    """Pairs that were looked for as such; where no single effect pays only those that run much nearer to PV."""
    single = max((rival.fit for rival in ranking), key=lambda fit: fit.score, default=base) if pays else base
    named = tuple(scanned for scanned in surveyed if scanned.block.code != UNNAMED)
    found = coupled(base, named, APART, single)
    return [pair for both in found if pays or nearer(both, base) for pair in pairs_of(both, base, ranking)]


def hidden(names: tuple[Rival, ...]) -> tuple[Rival, ...]:
    """Names that do not pay alone but bring the free run much nearer to PV: one of two effects that the noise hides as
    long as the other is missing.
    """
    gaining = [r for r in names if r.gain > LEAST_OF_PENALTY * r.block.penalty and makes_sense(r)]
    return tuple([r for r in gaining if nearer(r.fit, r.over)][:MOST_HIDDEN])


def leaders(ranking: tuple[Rival, ...]) -> tuple[Rival, ...]:
    """The first names that a second effect is looked for beside: the best, those close to it, and one that pays and
    runs much nearer to PV, whatever the other takes of the noise.
    """
    names = best_of_each_code(ranking)
    twins = TWINS.get(names[0].block.code, ())
    others = [r for r in names[1:] if worth(r) > 0.0 and r.block.code not in twins]
    close = [r for r in others if worth(r) > 0.5 * worth(names[0])]
    near = sorted((r for r in others if nearer(r.fit, names[0].fit)), key=lambda r: free_run_error(r.fit))
    return tuple(dict.fromkeys((names[0], *near[:1], *close)))[:LEADERS]


def seconds(rival: Rival, alone: tuple[Rival, ...], blocks: tuple[Block, ...]) -> Places:
    """What competes for the place beside a rival; names that did well alone begin from their values there too."""
    named = {rival.block.code, *TWINS.get(rival.block.code, ())}
    if rival.block.code in LIMITS:
        named |= LIMITS
    carried = tuple(r.fit.parts[-1] for r in alone if r.block.code not in named and worth(r) > 0.0)[:CARRIED]
    return Places(rival, ranked(rival.fit, tuple(block for block in blocks if block.code not in named), carried))


def chosen(pairs: list[Pair]) -> Pair:
    """The best pair by score; one that runs much nearer to PV goes before it where it is better under both noises
    taken together.
    """
    best = max(pairs, key=together)
    for pair in sorted(pairs, key=together, reverse=True):
        mine, other = pair.second.fit, best.second.fit
        behind = together(best) - together(pair)
        if any(timed(part.block) for part in mine.parts) or not nearer(mine, other):
            continue
        if gain_under(mine, other) > behind + 2.0 * SECOND_MUST_GAIN:
            best = pair
    return best


def own_doubt(best: Rival) -> float:
    """By how much a margin (nat) is to be divided: where no simulation was given the linear model came from the same
    record, its structure is a guess, and names that come within a third of each other are not told apart by it.
    """
    if best.fit.given.deviation < OWN_DEVIATION:
        return 1.0
    return max(OWN_SHARE * worth(best) / INDISTINCT, 1.0)


def hardly_slips(rival: Rival) -> bool:
    """Stiction whose slip jump is a small share of its band, which an uneven backlash looks like as well."""
    return rival.block.code == "valve.stiction" and float(rival.fit.parts[-1].values[1]) < SMALL_SLIP


def twins_of(rival: Rival) -> tuple[str, ...]:
    """Names that no record of OP and PV tells from this one, or not from one with such values."""
    code = rival.block.code
    return (*TWINS.get(code, ()), *CLOSE.get(code, ()), *(("valve.deadband",) if hardly_slips(rival) else ()))


def near(one: Rival, other: Rival) -> bool:
    """Whether two names have nearly the same form."""
    return any({one.block.code, other.block.code} <= family for family in NEAR)


def believed(best: Rival, names: tuple[Rival, ...], standing: float | None = None) -> Believed:
    """The best rival with the names that this record cannot tell from it. standing: what it is worth, where that is
    known from elsewhere.
    """
    standing = worth(best) if standing is None else standing
    twins = list(twins_of(best))
    others = [r for r in names if r.block.code != best.block.code and r.block.code not in twins]
    doubt = own_doubt(best)
    margins = {r.block.code: (standing - worth(r)) / doubt for r in others}
    limits = {r.block.code: max(INDISTINCT, NEAR_SHARE * standing * near(best, r)) for r in others}
    told = [r for r in others if r.block.code not in UNSAID and (worth(r) > 0.0 or near(best, r))]
    close = [r.block.code for r in told if margins[r.block.code] < limits[r.block.code]]
    alternatives = tuple((twins + close)[:MOST_ALTERNATIVES])
    unsaid = [margin for code, margin in margins.items() if code not in alternatives]
    return Believed(best.block.code, alternatives, best.gain, min(unsaid, default=float(np.inf)), best)
