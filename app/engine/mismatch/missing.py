"""What is missing, and beside which linear loop: the given one, one with parameters further off, or our own."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.compare.preparing import Prepared
from app.engine.mismatch.compare.thinning import (
    WANTED_SAMPLES,
    Coarse,
    Refined,
    coarse_of,
    factor_for,
    refined,
)
from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.restarting import may_hide_a_stem, restarted, takes_its_place
from app.engine.mismatch.compete.selection import Selection, select
from app.engine.mismatch.compete.worth import worth
from app.engine.mismatch.fit.fitting import Fit, fit_linear
from app.engine.mismatch.fit.refitting import freed, off_in_words, offered_beside, parameters_of
from app.engine.mismatch.judge.conclude import nothing_left, too_few
from app.engine.mismatch.loop.block import Block
from app.engine.mismatch.physics import fixed, library
from app.engine.mismatch.physics.generic import DYNAMIC

_NEARLY = 0.5


@dataclass(frozen=True, eq=False)
class Competed:
    """The linear loop that effects were looked for beside, and what was found. off: how far it is from the given one,
    where that is further than it was trusted; and why names are lost that a shorter record suggested.
    """

    base: Fit
    selection: Selection
    off: tuple[Reason, ...] = ()


def compete(prepared: Prepared) -> Competed:
    """The believed effects: of a long record chosen on a thinned one, their numbers fitted on the whole.

    What another gain, other time constants or a shorter dead time of the given simulation explain is no missing
    physics: what is missing is looked for again beside those.
    """
    base, already = prepared.base, tuple(pattern.part.block.code for pattern in prepared.patterns)
    if prepared.unrelated or too_few(base.record) or nothing_left(base):
        return Competed(base, Selection(base, (), ()))
    coarse = _shortened_for(base)
    blocks = library(coarse.fit.record)
    selection = select(coarse.fit, (*blocks, *offered_beside(base)), already, coarse.stems)
    off = parameters_of(selection.fit) if selection.effects else None
    if off is None:
        return _beside_own_dynamics(base, coarse, selection, blocks, already)
    given = freed(selection.fit, off)
    again = fit_linear(base.record, given)
    coarse = coarse_of(again, factor_for(again))
    selection = select(coarse.fit, blocks, already)
    fine = _finely(again, coarse, selection)
    return Competed(again, fine.selection, (off_in_words(base.given, given), *fine.lost))


def _shortened_for(base: Fit) -> Coarse:
    """What of a long record the names compete on: its beginning as sampled, where our own loop follows a stem there,
    whose slips no block means hold; the record thinned otherwise.
    """
    factor = factor_for(base)
    if factor > 1 and may_hide_a_stem(base):
        beginning = base.record.stretch(0, WANTED_SAMPLES)
        if not too_few(beginning) and np.ptp(beginning.op) > 0.0:
            alone = fit_linear(beginning, base.given)
            stems = restarted(alone, fixed())
            if any(takes_its_place(stem, None) for stem in stems):
                return Coarse(alone, factor, stems)
    coarse = coarse_of(base, factor)
    return replace(coarse, stems=restarted(coarse.fit, fixed()))


def _finely(base: Fit, coarse: Coarse, selection: Selection) -> Refined:
    return Refined(selection) if coarse.factor == 1 else refined(base, selection)


def _competed(base: Fit, fine: Refined) -> Competed:
    return Competed(base, fine.selection, fine.lost)


def _beside_own_dynamics(
    base: Fit, coarse: Coarse, selection: Selection, blocks: tuple[Block, ...], already: tuple[str, ...]
) -> Competed:
    """Where no simulation was given, linear dynamics that our own simple structures lack are no missing physics: they
    become part of our own loop, and what is missing beside them is looked for again.
    """
    own = _lacking_dynamics(selection)
    if own is None:
        return _competed(base, _finely(base, coarse, selection))
    named = tuple(block for block in blocks if block.name != own.block.name)
    if any(worth(r) > _NEARLY * worth(own) for r in selection.ranking if r.block.code != own.block.code):
        # A name with one or two parameters explains nearly what four lags without a name do: it goes before them.
        return _competed(base, _finely(base, coarse, select(coarse.fit, named, already, coarse.stems)))
    richer = own.fit if coarse.factor == 1 else refined(base, Selection(own.fit, selection.effects, ())).selection.fit
    return _competed(richer, _finely(richer, coarse, select(own.fit, named, already)))


def _lacking_dynamics(selection: Selection) -> Contender | None:
    """The generic linear dynamics, where they came first beside a linear loop of our own."""
    if not selection.ranking or not selection.effects:
        return None
    first = max((effect.contender for effect in selection.effects), key=lambda contender: contender.gain)
    own = first.fit.given.own
    return first if own and first.block is DYNAMIC and len(first.fit.parts) == 1 else None
