"""The foremost effect looked for again beside each other one: an effect that does not pay alone, and that a scan beside
the foremost passes over, may leave the foremost much more to explain where it was fitted first.
"""

from dataclasses import dataclass

import numpy as np

from app.engine.mismatch.compete.competition import Contender, Scanned, descended, solved_sensibly
from app.engine.mismatch.compete.pairing import Couple, fit_again, placed, searched_again
from app.engine.mismatch.compete.ranking import best_of_each_code, ranked
from app.engine.mismatch.compete.worth import SECOND_MUST_GAIN
from app.engine.mismatch.fit.fitting import Fit, quiet_noise
from app.engine.mismatch.fit.scan import ground, scan
from app.engine.mismatch.loop.block import Context, Part

_OTHERS, _PURSUED, _STEPS = 5, 2, 6


@dataclass(frozen=True, eq=False)
class _Promise:
    """The foremost effect, begun beside another. more: what both would explain beyond what the foremost does alone
    (nat), the other's penalty counted; what a fit makes of the scan's point is taken to be the same beside both.
    """

    beside: Contender
    begun: Part
    more: float


def looked_ahead(
    base: Fit,
    surveyed: tuple[Scanned, ...],
    couples: tuple[Couple, ...],
    ranking: tuple[Contender, ...],
    apart: tuple[frozenset[str], ...],
) -> tuple[Fit, ...]:
    """The most promising couples of the first of a ranking and another effect, fitted beside the linear refit (base).

    surveyed: the scans beside that refit. couples: what they promise together. apart: groups of codes of which only one
    is taken.
    """
    if not ranking:
        return ()
    forms = _forms_of(ranking, surveyed)
    others = _others_of(base, surveyed, couples, ranking, apart)
    promises = [promise for beside in others for promise in _promised(beside, forms)]
    best = sorted(promises, key=lambda promise: -promise.more)[:_PURSUED]
    return tuple(fit_again(searched_again(_together(promise))) for promise in best)


def _forms_of(ranking: tuple[Contender, ...], surveyed: tuple[Scanned, ...]) -> tuple[tuple[Scanned, float], ...]:
    """The forms of the first of a ranking that were fitted, and by how much each is behind the first (nat)."""
    first, known = ranking[0], {contender.block.name: contender for contender in ranking}
    return tuple(
        (scanned, first.score - known[scanned.block.name].score)
        for scanned in surveyed
        if scanned.block.code == first.block.code and scanned.block.name in known
    )


def _others_of(
    base: Fit,
    surveyed: tuple[Scanned, ...],
    couples: tuple[Couple, ...],
    ranking: tuple[Contender, ...],
    apart: tuple[frozenset[str], ...],
) -> tuple[Contender, ...]:
    """What the first of a ranking is looked for beside: its partners in couples, which are fitted where they did not
    compete, and the next names of the ranking.
    """
    first = ranking[0].block.code
    partners = [part.block for couple in couples for part in _partner_of(couple, first)]
    known = {contender.block.name: contender for contender in ranking}
    scans = {scanned.block.name: scanned for scanned in surveyed}
    fitted = [
        contender
        for block in partners
        if block.name not in known and block.name in scans
        for contender in ranked(base, (block,), surveyed=(scans[block.name],))
    ]
    allowed = [
        contender
        for contender in best_of_each_code(ranking)
        if contender.block.name in scans and contender.block.code != first
        if not any({first, contender.block.code} <= group for group in apart)
    ]
    named = [known[block.name] for block in partners if block.name in known]
    return tuple(dict.fromkeys((*named, *fitted, *allowed[:_OTHERS])))


def _partner_of(couple: Couple, code: str) -> tuple[Part, ...]:
    """The other part of a couple that holds a code; none of one that does not."""
    one, other = couple.parts
    return (other,) if one.block.code == code else (one,) if other.block.code == code else ()


def _promised(beside: Contender, forms: tuple[tuple[Scanned, float], ...]) -> tuple[_Promise, ...]:
    """The best form of an effect beside another, where both would explain more than the other costs: under the noise
    that the other leaves, or under quiet noise. forms: each with how far it is behind the best one alone.
    """
    own = beside.fit
    context = Context(own.record, own.plant)
    under = ground(own, own.noise), ground(own, quiet_noise(own.record, own.given))
    found = []
    for form, behind in forms:
        for scanned, before in zip(scan(form.block, under), (form.gain, form.quiet_gain), strict=True):
            starts = solved_sensibly(scanned, form.block, context)
            if starts and np.isfinite(before):
                more = beside.score + starts[0].gain - before - behind
                found.append(_Promise(beside, Part(form.block, starts[0].values), more))
    best = max(found, key=lambda promise: promise.more, default=None)
    return () if best is None or best.more < SECOND_MUST_GAIN else (best,)


def _together(promise: _Promise) -> Fit:
    fit = promise.beside.fit
    return descended(*placed(fit, (*fit.parts, promise.begun)), _STEPS)
