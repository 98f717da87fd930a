"""What makes PV late in one way fitted as well as what does so in another: a dead time, a lag, an inverse response."""

import numpy as np

from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.fit.fitting import fit
from app.engine.mismatch.fit.scan import task_with
from app.engine.mismatch.fit.task import start_at
from app.engine.mismatch.loop.block import Block, Context
from app.engine.mismatch.physics import LATE

ROUNDS, STEPS = 2, 6


def with_kindred(ranking: tuple[Contender, ...], best: Contender, blocks: tuple[Block, ...]) -> tuple[Contender, ...]:
    """A ranking in which the kindred of its `best` have begun where that one stands as well: a scan beside the linear
    model may have passed them over, and what was begun badly seems further behind than it is.
    """
    if best.block.code not in LATE:
        return ranking
    known = {contender.block.name: contender for contender in ranking}
    for block in blocks:
        if block.code in LATE and block.code != best.block.code:
            there = begun_at(block, best)
            known[block.name] = max(known.get(block.name, there), there, key=lambda contender: contender.gain)
    return tuple(known.values())


def begun_at(block: Block, best: Contender) -> Contender:
    """A block beside the same fit, begun where it makes PV as late as the best one does."""
    values, start = best.fit.parts[-1].values, best.fit
    task = task_with(best.over, block)
    count = len(block.parameters(Context(start.record, start.plant)))
    late = np.full(count, float(np.sum(values)) / count)
    x = start_at(task, start.plant, np.concatenate((*(part.values for part in start.parts[:-1]), late)))
    found = fit(task, x, start.noise, ROUNDS, STEPS)
    return Contender(block, found, found.likelihood - best.over.likelihood, best.over)
