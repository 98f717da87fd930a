"""Pairs of effects: a second beside a first, each of which is worth having beside the other, and the best of them."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.limits import limit_bonus
from app.engine.mismatch.compete.naming import Believed, believed, own_doubt, twins_of
from app.engine.mismatch.compete.pairing import alone_as, reordered
from app.engine.mismatch.compete.ranking import best_of_each_code, reconciled
from app.engine.mismatch.compete.searching import best_alone
from app.engine.mismatch.compete.worth import (
    SECOND_MUST_GAIN,
    gain_under,
    hidden_from,
    hidden_gain,
    makes_sense,
    nearer,
    pays_beside,
    timed,
    worth,
    worth_beside,
)
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.loop.block import Block


@dataclass(frozen=True, eq=False)
class Pair:
    """A second effect beside a first. first_gain: what the first gains beside the second (nat). names: all that
    competed for the second place.
    """

    first: Contender
    second: Contender
    first_gain: float
    names: tuple[Contender, ...]

    @property
    def blocks(self) -> tuple[Block, Block]:
        return self.first.block, self.second.block

    def alone(self, place: int, base: Fit) -> Contender:
        """The first effect (0), or the second (1), alone."""
        return self.first if place == 0 else alone_as(self.second.fit.parts[-1], base, base.plant)


@dataclass(frozen=True, eq=False)
class Places:
    """A first effect, and what competed for the place beside it, the best first."""

    first: Contender
    ranking: tuple[Contender, ...]

    def pairs(self, alone: tuple[Contender, ...]) -> tuple[Pair, ...]:
        """The best second effect, where each of the two is worth having beside the other; `alone`: single effects."""
        if not self.ranking:
            return ()
        best, beside = self.ranking[0], max(self.ranking, key=worth_beside)
        taken = (best,) if beside is best else (best, beside)
        return tuple(pair for second in taken for pair in self.pair_with(second, alone))

    def pair_with(self, best: Contender, alone: tuple[Contender, ...]) -> tuple[Pair, ...]:
        if not pays_beside(best, self.first):
            return ()
        contender = self.first
        other = max((r.fit.likelihood for r in alone if r.block.code == best.block.code), default=-np.inf)
        first_gain = best.fit.likelihood - max(other, contender.fit.likelihood - contender.gain)
        # What says least must explain most: by scores, not likelihoods.
        strongest = max((contender.over, *(r.fit for r in alone)), key=lambda fit: fit.score)
        if first_gain < contender.block.penalty + SECOND_MUST_GAIN or not _over_single(best, strongest):
            return ()
        return (Pair(contender, best, first_gain, best_of_each_code(self.ranking)),)


def _over_single(second: Contender, strongest: Fit) -> bool:
    """Whether a pair says more than the strongest single effect, with what the noise beside that hid of it."""
    gained = second.fit.score - strongest.score
    if gained >= SECOND_MUST_GAIN or hidden_gain(second) == 0.0:
        return gained >= SECOND_MUST_GAIN
    return gained + hidden_from(second.fit, strongest) >= SECOND_MUST_GAIN


def pairs_of(found: Fit, base: Fit, ranking: tuple[Contender, ...]) -> tuple[Pair, ...]:
    """A couple that was fitted together as a pair: the first is that which did better alone."""
    known = {contender.block.name: contender for contender in reversed(ranking)}
    alone = [known.get(part.block.name) or alone_as(part, base, found.plant) for part in found.parts[-2:]]
    order = (0, 1) if alone[0].fit.likelihood >= alone[1].fit.likelihood else (1, 0)
    first, both = alone[order[0]], reordered(found, order)
    second = reconciled(Contender(both, first.fit))
    return Places(first, (second,)).pairs(best_of_each_code(ranking))


def paying_alone(pair: Pair, base: Fit, ranking: tuple[Contender, ...], blocks: tuple[Block, ...]) -> Contender | None:
    """The better of a pair alone, where one of them does not pay beside the other as well as that is known alone: a
    start that only the pair had is nothing that the one beside explains. None where both pay.
    """
    found = pair.second.fit
    known = {contender.block.name: contender for contender in reversed(ranking)}
    first, second = (best_alone(p, found, base, known.get(p.block.name), blocks) for p in found.parts[-2:])
    beside = reconciled(Contender(found, first.fit))
    singles = (*best_of_each_code(ranking), *(contender for contender in (first, second) if makes_sense(contender)))
    if Places(first, (beside,)).pairs(singles):
        return None
    return max(first, second, key=worth)


def with_contenders(pair: Pair, beside: dict[str, Places]) -> Pair:
    """A pair with all names that competed for its second place, where they were found without it as well."""
    places = beside.get(pair.first.block.name)
    if places is None or any(contender is pair.second for contender in places.ranking):
        return pair
    names = sorted((pair.second, *places.ranking), key=lambda contender: -worth(contender))
    return replace(pair, names=best_of_each_code(tuple(names)))


def chosen(pairs: list[Pair]) -> Pair:
    """The best pair by score; one that runs much nearer to PV goes before it where it is better under both noises
    taken together.
    """
    best = max(pairs, key=_together)
    for pair in sorted(pairs, key=_together, reverse=True):
        mine, other = pair.second.fit, best.second.fit
        behind = _together(best) - _together(pair)
        if any(timed(part.block) for part in mine.parts) or not nearer(mine, other):
            continue
        if gain_under(mine, other) > behind + 2.0 * SECOND_MUST_GAIN:
            best = pair
    return best


def _together(pair: Pair) -> float:
    """A pair's score, with what the quiet of its limited stretches says."""
    return _heard(pair.second.fit)


def _heard(fit: Fit) -> float:
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
    standing = max(worth(again), _together(pair) - _heard(beside_second.first.fit))
    beside = believed(again, names, standing)
    return replace(alone, alternatives=beside.alternatives, margin=beside.margin)
