"""Sticking stems as contenders, each beside the linear loop that is found behind it: found from OP our own loop has the
stem's work in it, a dead time and a lag that the process has not, and no fit of a stem leaves that hill.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from app.engine.mismatch.compete.competition import Contender, descended
from app.engine.mismatch.compete.ranking import best_of_each_code, by_worth
from app.engine.mismatch.compete.searching import score_of, searched
from app.engine.mismatch.compete.worth import worth
from app.engine.mismatch.fit.fitting import Fit, fit, task_of
from app.engine.mismatch.fit.free_run import runs_nearer, stem_swing
from app.engine.mismatch.fit.given import identify
from app.engine.mismatch.fit.stems import ShownStem, shown_stems, walking
from app.engine.mismatch.fit.task import OWN_DEVIATION, Given, Task, make_task, start_at
from app.engine.mismatch.loop.block import Block
from app.engine.mismatch.loop.chain import signal_after
from app.engine.mismatch.physics.valve_deadband import DEADBAND
from app.engine.mismatch.physics.valve_stiction import HE, slipping_as
from app.engine.recording import FloatArray

STICKS, _BACKLASH = HE.name, DEADBAND.name
_PURSUED, _OF_A_WALK = 4, 3  # of those begun, how many are fitted to their end
_STEPS, _ROUNDS = 6, 3
_OTHER_SLIPS, _WALKS = np.linspace(0.05, 1.0, 20), 2
_LIKELIER = 1.0  # nat
_AGAIN = 3
_SLIPS_WELL = 0.4  # J / S. Measured: docs/PROOF.md
_MORE_ASKED = 25.0
"""What a stem beside a loop found behind it has to be worth, nat: that loop was chosen among many, one for each stem.
Measured on healthy and sticking loops: docs/PROOF.md."""


def with_stems_shown(ranking: tuple[Contender, ...], stems: tuple[Contender, ...]) -> tuple[Contender, ...]:
    """A ranking with the stems that its record shows, each in the place of the contender of its code where it is
    likelier and its free run nearer to PV.
    """
    known = {contender.block.code: contender for contender in best_of_each_code(ranking)}
    shown = tuple(stem for stem in stems if takes_its_place(stem, known.get(stem.block.code)))
    beaten = [known.get(stem.block.code) for stem in shown]
    return by_worth((*shown, *(contender for contender in ranking if contender not in beaten))) if shown else ranking


def may_hide_a_stem(base: Fit) -> bool:
    """Whether a linear loop was found from OP as it was recorded, and from nothing else."""
    return base.given.own and not base.parts and base.record.finer is None


def takes_its_place(contender: Contender, known: Contender | None) -> bool:
    """Whether a stem with a loop of its own is believed before what is known of its code, or before none."""
    before = contender.over if known is None else known.fit
    likelier = contender.fit.score > before.score + _LIKELIER
    return likelier and stands(contender.fit, before) and worth(contender) > _MORE_ASKED


def stands(found: Fit, before: Fit) -> bool:
    """Whether the free run behind a stem is nearer to PV than another."""
    return runs_nearer(found, before, stem_swing(found))


def by_likelihood(fits: Sequence[Fit], base: Fit) -> list[Fit]:
    return sorted(fits, key=score_of, reverse=True)


def by_standing(fits: Sequence[Fit], base: Fit) -> list[Fit]:
    """Stems, the likeliest first; those that stand before all others where one of them slips well.

    What a stem hides between two samples it may take a tiny slip and a huge gain to mimic: likelier by the noise that
    this leaves, and refused for its free run. It must not displace one that stands. Where none that stands slips well
    it may: a load alone brings the free run of a stem that only lags behind OP nearer, with a sound valve too.
    """
    standing = [found for found in fits if stands(found, base)]
    if not any(_slips_well(found) for found in standing):
        standing = []
    others = [found for found in fits if not any(found is one for one in standing)]
    return [*by_likelihood(standing, base), *by_likelihood(others, base)]


Order = Callable[[Sequence[Fit], Fit], list[Fit]]
"""Which of some stems are foremost."""


def _slips_well(found: Fit) -> bool:
    """Whether a stem slips by much of its band, and makes edges that no load makes."""
    return stem_swing(found) is not None and bool(found.parts[-1].values[1] >= _SLIPS_WELL)


def restarted(base: Fit, blocks: tuple[Block, ...]) -> tuple[Contender, ...]:
    """Of each code the best stem that the record shows, beside the linear loop behind it: the likeliest ones, or, where
    each of these is refused, those whose free run stands. None where a simulation was given.
    """
    if not may_hide_a_stem(base):
        return ()
    record = base.record
    begun = _begun_behind(base, shown_stems(record, base.noise) or shown_stems(record, walking(record)), blocks)
    likeliest = _looked_for(base, begun, blocks, by_likelihood)
    if not likeliest or any(takes_its_place(stem, None) for stem in likeliest):
        return likeliest
    standing = _looked_for(base, begun, blocks, by_standing)
    return standing if any(takes_its_place(stem, None) for stem in standing) else likeliest


def _looked_for(base: Fit, begun: list[Fit], blocks: tuple[Block, ...], order: Order) -> tuple[Contender, ...]:
    """Stems are looked for again as long as that brings a better one: near its loop and under its noise they stand out
    more sharply.
    """
    ended = _to_their_end(base, begun, order)
    for _ in range(_AGAIN if ended else 0):
        best = order(ended, base)[0]
        nearer = _begun_behind(base, shown_stems(base.record, best.noise, best.plant), blocks)
        ended += _to_their_end(base, nearer, order)
        again = order(ended, base)[0]
        if abs(again.score - best.score) < _LIKELIER:
            break
    of_each: dict[str, list[Fit]] = {}
    for found in ended:
        of_each.setdefault(found.parts[-1].block.code, []).append(found)
    return tuple(_pursued(base, order(fits, base)[0], blocks, order) for fits in of_each.values())


def _begun_behind(base: Fit, stems: tuple[ShownStem, ...], blocks: tuple[Block, ...]) -> list[Fit]:
    """A few steps of a fit from each stem, with the linear loop behind it."""
    named = {block.name: block for block in blocks}
    begun = []
    for stem in stems:
        block = named.get(STICKS if stem.share > 0.0 else _BACKLASH)
        if block is not None:
            begun.append(descended(*begun_at(base, stem, block), _STEPS))
    return begun


def _to_their_end(base: Fit, begun: list[Fit], order: Order) -> list[Fit]:
    """The foremost ones."""
    return [to_its_end(first) for first in order(begun, base)[:_PURSUED]]


def begun_at(base: Fit, stem: ShownStem, block: Block) -> tuple[Task, FloatArray]:
    """The task of fitting a stem with the simple loop behind it, and where it begins."""
    given = Given(stem.plant, OWN_DEVIATION, integrating=stem.plant.leak == 0.0, behind_stem=True)
    task = make_task(base.record, given, (block,))
    size = (stem.S,) if block.name == _BACKLASH else (stem.S, stem.share)
    return task, start_at(task, stem.plant, np.array((*size, stem.start)))


def to_its_end(found: Fit) -> Fit:
    return fit(task_of(found), found.x, found.noise, _ROUNDS, _STEPS)


def _pursued(base: Fit, first: Fit, blocks: tuple[Block, ...], order: Order) -> Contender:
    """A stem over all sizes of its slip, beside the loop that it began with and beside another order of it, and looked
    for again on a fine grid.
    """
    stem = first.parts[-1]
    walked = over_its_slips(first, base, order)
    moved = signal_after(walked.record, walked.plant, walked.parts, walked.parts[-1]) + walked.record.op_mid
    given = replace(identify(base.record.with_op(moved)).given, behind_stem=True)
    task = make_task(base.record, given, (stem.block,))
    other = fit(task, start_at(task, given.plant, walked.parts[-1].values), None, _ROUNDS, _STEPS)
    best = order((walked, other), base)[0]
    return Contender(order((best, searched(Contender(best, base), blocks).fit), base)[0], base)


def over_its_slips(found: Fit, base: Fit, order: Order) -> Fit:
    """The best fit with another size of slip: each stem that slips first where this one does, the gain in proportion.
    From one to the next the first slip falls into other samples unless all of them move together, which no descent
    does.
    """
    for _ in range(_WALKS if found.parts[-1].block.name == STICKS else 0):
        task, values = task_of(found), found.parts[-1].values
        begun = []
        for share in _OTHER_SLIPS:
            plant = found.plant.changed(K=found.plant.K * values[1] / share)
            begun += [descended(task, start_at(task, plant, other), _STEPS) for other in slipping_as(values, share)]
        ended = [to_its_end(first) for first in sorted(begun, key=score_of)[-_OF_A_WALK:]]
        best = order((found, *ended), base)[0]
        if best is found:
            break
        found = best
    return found
