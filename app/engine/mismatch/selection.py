"""Which effects are believed: the best rival while it pays, a second beside it, and what cannot be told from them."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.mismatch.block import Block, Context, Part
from app.engine.mismatch.compete import Rival, rivals
from app.engine.mismatch.fitting import OWN_DEVIATION, Fit, by_free_run, fit, make_task, start_at
from app.engine.mismatch.limits import limit_bonus, limits_always
from app.engine.mismatch.physics import CLOSE, TWINS
from app.engine.mismatch.richer_noise import taken_by_noise
from app.engine.mismatch.scan import task_with
from app.engine.mismatch.spikes import steady_gain, tail_penalty

LEADERS = 3
CARRIED = 3
SECOND_MUST_GAIN = 4.0
SECOND_SHARE, SECOND_ENOUGH = 0.06, 30.0
HIDDEN_SHARE, HIDDEN_NEARER, MOST_HIDDEN = 0.6, 0.8, 2
INDISTINCT = 5.0
MOST_ALTERNATIVES = 2
SMALL_SLIP = 0.35
# One limit of PV is one effect, whichever of these it is called.
LIMITS = {"process.overflow", "sensor.saturation"}
STEADY_SHARE = 0.4
NO_WORSE = 1.03
OWN_SHARE = 0.35
UNNAMED = "unnamed"


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
    """The final fit, its effects in the order of their gain, and the first round's ranking (for evidence)."""

    fit: Fit
    effects: tuple[Believed, ...]
    ranking: tuple[Rival, ...]


def worth(rival: Rival) -> float:
    """A rival's score: what it gains beyond its penalty, spikes aside, and what the quiet of its limited stretches
    says; below 0 where richer noise would have taken as much.
    """
    part = rival.fit.parts[-1]
    if not makes_sense(rival):
        return -np.inf
    if part.block.abrupt:
        own = rival.score - tail_penalty(rival.fit)
    else:
        own = min(rival.score, steady_gain(rival) - STEADY_SHARE * rival.block.penalty)
        own += limit_bonus(rival.fit, part) if own > 0.0 else 0.0
    return own if own <= 0.0 or own > (taken := taken_by_noise(rival)) else own - taken


def makes_sense(rival: Rival) -> bool:
    """Whether the fitted values still are what the code says, and the free run is no worse: noise must not take its
    place.
    """
    part = rival.fit.parts[-1]
    if part.block.sensible is not None and not part.block.sensible(
        part.values, Context(rival.fit.record, rival.fit.plant)
    ):
        return False
    return no_worse(rival.fit, rival.over) and not limits_always(rival.fit, part)


def ranked(found: Fit, blocks: tuple[Block, ...], carried: tuple[Part, ...] = ()) -> tuple[Rival, ...]:
    competed = (reconciled(rival) for rival in rivals(found, blocks, carried))
    return tuple(sorted(competed, key=lambda rival: -worth(rival)))


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
    first = ranked(base, offered)
    asked = SECOND_MUST_GAIN if already else 0.0
    names = best_of_each_code(first)
    pays = bool(first) and worth(first[0]) > asked
    single = Selection(first[0].fit, (believed(first[0], names),), first) if pays else Selection(base, (), first)
    begun = leaders(first) if pays else hidden(names)
    beside = {rival.block.name: seconds(rival, names, offered) for rival in begun}
    pairs = [pair for places in beside.values() for pair in places.pairs(names)]
    if not pairs:
        return single
    partner = partner_of(max(pairs, key=together), base, set(beside))
    if partner is not None:
        places = beside[partner.block.name] = seconds(partner, names, offered)
        pairs += places.pairs(names)
    best = max(pairs, key=together)
    alone = first_from_pair(best)
    if alone is not None:
        return Selection(alone.fit, (believed(alone, names),), first) if pays else single
    effects = (first_of(best, beside.get(best.second.block.name)), believed(best.second, best.names))
    return Selection(best.second.fit, tuple(sorted(effects, key=lambda effect: -effect.gain)), names)


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
        if not self.ranking or not pays_beside(self.ranking[0], self.first):
            return ()
        rival, best = self.first, self.ranking[0]
        # What says least must explain most: by scores, not likelihoods.
        strongest = max(rival.over.score, *(r.fit.score for r in alone))
        other = max((r.fit.likelihood for r in alone if r.block.code == best.block.code), default=-np.inf)
        first_gain = best.fit.likelihood - max(other, rival.fit.likelihood - rival.gain)
        if best.fit.score - strongest < SECOND_MUST_GAIN or first_gain < rival.block.penalty + SECOND_MUST_GAIN:
            return ()
        return (Pair(rival, best, first_gain, best_of_each_code(self.ranking)),)


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


def together(pair: Pair) -> float:
    """A pair's score, with what the quiet of its limited stretches says."""
    fit = pair.second.fit
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
    standing = max(worth(again), together(pair) - beside_second.first.fit.score)
    near = believed(again, names, standing)
    return replace(alone, alternatives=near.alternatives, margin=near.margin)


def partner_of(pair: Pair, base: Fit, tried: set[str]) -> Rival | None:
    """The effect of a pair that was found second, alone: beside it the first may turn out to have another name."""
    part = pair.second.fit.parts[-1]
    if part.block.name in tried:
        return None
    task = task_with(base, part.block)
    known = [known.values for known in base.parts]
    alone = fit(task, start_at(task, base.plant, np.concatenate((*known, part.values))), None, 2, 6)
    return Rival(part.block, alone, alone.likelihood - base.likelihood, base)


def hidden(names: tuple[Rival, ...]) -> tuple[Rival, ...]:
    """Names that do not pay alone but bring the free run much nearer to PV: one of two effects that the noise hides as
    long as the other is missing.
    """
    near = [r for r in names if r.gain > HIDDEN_SHARE * r.block.penalty and makes_sense(r) and nearer(r)]
    return tuple(near[:MOST_HIDDEN])


def nearer(rival: Rival) -> bool:
    return free_run_error(rival.fit) < HIDDEN_NEARER * free_run_error(rival.over)


def no_worse(fit: Fit, over: Fit) -> bool:
    """Whether the free run of one fit is no worse than that of another."""
    return free_run_error(fit) < NO_WORSE * free_run_error(over)


def free_run_error(fit: Fit) -> float:
    """Standard deviation of PV less its free run, in the unit of PV, over the samples that are compared."""
    return float(np.std(fit.residual[fit.record.usable]))


def leaders(ranking: tuple[Rival, ...]) -> tuple[Rival, ...]:
    """The first names that a second effect is looked for beside: close to the best."""
    names = best_of_each_code(ranking)
    best = worth(names[0])
    twins = TWINS.get(names[0].block.code, ())
    close = [r for r in names[1:] if worth(r) > 0.5 * best and worth(r) > 0.0 and r.block.code not in twins]
    return (names[0], *close[: LEADERS - 1])


def seconds(rival: Rival, alone: tuple[Rival, ...], blocks: tuple[Block, ...]) -> Places:
    """What competes for the place beside a rival; names that did well alone begin from their values there too."""
    named = {rival.block.code, *TWINS.get(rival.block.code, ())}
    if rival.block.code in LIMITS:
        named |= LIMITS
    carried = tuple(r.fit.parts[-1] for r in alone if r.block.code not in named and worth(r) > 0.0)[:CARRIED]
    return Places(rival, ranked(rival.fit, tuple(block for block in blocks if block.code not in named), carried))


def pays_beside(second: Rival, first: Rival) -> bool:
    return worth(second) >= SECOND_MUST_GAIN and second.gain >= min(SECOND_SHARE * first.gain, SECOND_ENOUGH)


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


def believed(best: Rival, names: tuple[Rival, ...], standing: float | None = None) -> Believed:
    """The best rival with the names that this record cannot tell from it. standing: what it is worth, where that is
    known from elsewhere.
    """
    standing = worth(best) if standing is None else standing
    twins = list(twins_of(best))
    others = [r for r in names if r.block.code != best.block.code and r.block.code not in twins]
    doubt = own_doubt(best)
    margins = [(standing - worth(r)) / doubt for r in others]
    close = [r.block.code for r, m in zip(others, margins, strict=True) if m < INDISTINCT and worth(r) > 0.0]
    close = [code for code in close if code != UNNAMED]
    nearest = min(margins, default=float(np.inf))
    return Believed(best.block.code, tuple((twins + close)[:MOST_ALTERNATIVES]), best.gain, nearest, best)
