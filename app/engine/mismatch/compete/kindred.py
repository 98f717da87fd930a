"""What makes PV late in one way fitted as well as what does so in another: a dead time, a lag, an inverse response. And
what sets in at a time: at once, straight, or slower and slower; a stem that sticks all along, or from a time on.
"""

import numpy as np

from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.fit.fitting import fit, residual_rows, task_of
from app.engine.mismatch.fit.scan import task_with
from app.engine.mismatch.fit.task import start_at
from app.engine.mismatch.loop.block import Block, Context, grid
from app.engine.mismatch.physics import LATE
from app.engine.mismatch.physics.additive import LEVELLING, LOAD_STEP, SENSOR_DRIFT, SENSOR_STEP
from app.engine.mismatch.physics.moments import EDGE
from app.engine.mismatch.physics.scales import slowness
from app.engine.mismatch.physics.valve_stiction import CHOUDHURY_SETS_IN, SETS_IN
from app.engine.mismatch.physics.valve_stiction import CODE as STICTION
from app.engine.recording import FloatArray

_ROUNDS, _STEPS = 2, 6
_STEPS_IN_TIME, _SET_IN = (LOAD_STEP.name, SENSOR_STEP.name), (SENSOR_DRIFT.name, LEVELLING.name)
_STICKS_SINCE = (SETS_IN.name, CHOUDHURY_SETS_IN.name)
_MOMENTS = np.linspace(EDGE, 1.0 - EDGE, 9)  # of the record
_SIZES, _SLIPS = np.exp(np.linspace(-0.2, 0.3, 6)), np.array([0.1, 0.3, 0.5, 0.7, 0.9])  # of the size found; J / S
_LASTING = (2.0, 5.0)  # of the process's slowest time


def with_kindred(ranking: tuple[Contender, ...], best: Contender, blocks: tuple[Block, ...]) -> tuple[Contender, ...]:
    """A ranking in which the kindred of its `best` have begun where that one stands as well: a scan beside the linear
    model may have passed them over, and what was begun badly seems further behind than it is.
    """
    known = {contender.block.name: contender for contender in ranking}
    for block in blocks:
        for values in _places_to_begin(block, best):
            there = _begun_at(block, best, values)
            known[block.name] = max(known.get(block.name, there), there, key=lambda contender: contender.gain)
    return tuple(known.values())


def _places_to_begin(block: Block, best: Contender) -> tuple[FloatArray, ...]:
    """Where a block is to begin (P,) beside its kindred `best`; nowhere where they are not kindred."""
    found, context = best.fit.parts[-1].values, Context(best.fit.record, best.fit.plant)
    if {block.code, best.block.code} <= LATE and block.code != best.block.code:
        count = len(block.parameters(context))
        return (np.full(count, float(np.sum(found)) / count),)
    if best.block.code == STICTION and block.name in _STICKS_SINCE and block.name != best.block.name:
        return _since_when(block, best)
    if best.block.name in _STEPS_IN_TIME and block.name in _SET_IN:
        return tuple(np.array([found[0], lasting * slowness(context), found[1]]) for lasting in _LASTING)
    return ()


def _since_when(block: Block, best: Contender) -> tuple[FloatArray, ...]:
    """From when on a stem of about the size of the `best` one explains PV best, under the noise that one leaves; never
    where it explains more as it is.
    """
    task, found = task_with(best.over, block), best.fit
    (size, slip), moments = found.parts[-1].values[:2], _MOMENTS * found.record.duration_s
    tried = grid(np.minimum(size * _SIZES, found.record.op_range), np.append(_SLIPS, slip), moments)
    known = [part.values for part in found.parts[:-1]]
    places = [start_at(task, found.plant, np.concatenate((*known, values))) for values in tried]
    costs = [residual_rows(task, x, found.noise).cost for x in places]
    there = int(np.argmin(costs))
    return (tried[there],) if costs[there] < residual_rows(task_of(found), found.x, found.noise).cost else ()


def _begun_at(block: Block, best: Contender, values: FloatArray) -> Contender:
    """A block beside the same fit as the best one, begun at these values (P,) where that one stands."""
    start, task = best.fit, task_with(best.over, block)
    x = start_at(task, start.plant, np.concatenate((*(part.values for part in start.parts[:-1]), values)))
    return Contender(fit(task, x, start.noise, _ROUNDS, _STEPS), best.over)
