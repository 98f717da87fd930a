"""Whether PV answers OP: whether it is held while loads would carry it away, or OP foretells what it does next.

Behind a valve that stands fast PV goes its own way, and OP, which a controller makes of PV, follows it: the two look as
much alike as in a loop at work, and such a loop hardly cycles.
"""

import numpy as np

from app.engine.causality.foretelling import FORETOLD, Lags, fitted, left_over, not_far
from app.engine.fitness.signals import STANDING, standing
from app.engine.recording import BoolArray, FloatArray, UniformRecord
from app.engine.signals.sampled import blocks, slow_share, unlike

SHORTEST_BLOCK, FEWEST_BLOCKS = 16, 8
HELD = 0.93
"""Share of the variance of PV that lies between blocks of any length, at most: what is held comes back within some.
Chosen on simulated loads that wander (`testbench.days --process slow`), so that loops tuned up to four times as
sluggishly as usual pass.
"""

ORDER = 8
"""How many of the last means are looked at."""

STRIDES = (16, 8, 4, 2, 1)
"""Samples that are averaged into one, the coarsest first: a quick loop answers within some of them, a slow one within
some of the coarsest."""


def goes_its_own_way(record: UniformRecord) -> bool:
    """Whether PV is neither held, nor foretold by OP beyond what its own past foretells.

    False where too little moves to tell. Misleads in both directions, as any look at a closed loop that nobody excites:
    a load that comes back by itself holds PV too, a quiet record may show no answer that is there.
    """
    stands = standing(record.pv, record.op) >= STANDING
    return not (_is_held(record, ~stands) or any(_foretells(record, stands, stride) for stride in STRIDES))


def _is_held(record: UniformRecord, moving: BoolArray) -> bool:
    pv = (record.pv if record.sp is None else unlike(record.pv, record.sp))[moving]
    length = SHORTEST_BLOCK
    while length * FEWEST_BLOCKS <= len(pv):
        if slow_share(blocks(pv, length)) > HELD:
            return False
        length *= 2
    return True


def _foretells(record: UniformRecord, stands: BoolArray, stride: int) -> bool:
    """Whether the last means of OP add to what PV's own past foretells of its next one, by more than their number is
    worth (Bayesian information criterion).

    Of all samples, or of all but those that PV's past misses by far: an upset may hide everything else, a step of the
    set point shows it. Source: Schwarz 1978, Estimating the dimension of a model, doi 10.1214/aos/1176344136.
    """
    lags = Lags(stride, ORDER)
    if not lags.fit_in(record.samples):
        return False
    own = np.vstack((lags.ones(record.pv), lags.whole_past(record.pv)))
    rows = np.vstack((own, lags.past(record.op, ORDER), lags.value(record.pv)))
    rows = np.compress(~lags.touched(stands, ORDER), rows, axis=1)
    terms, values = len(own), rows.shape[1]
    if values < lags.fewest:
        return False
    gram = rows @ rows.T
    if _adds(gram, values, terms):
        return True
    kept = np.compress(not_far(rows[-1] - fitted(gram, terms) @ rows[:terms]), rows, axis=1)
    return kept.shape[1] >= lags.fewest and _adds(kept @ kept.T, kept.shape[1], terms)


def _adds(gram: FloatArray, n: int, terms: int) -> bool:
    """gram: of ones and the past of PV (`terms`), ORDER of the past of OP, and what PV is next, over n means."""
    alone, both = left_over(gram, terms), left_over(gram, terms + ORDER)
    if alone <= FORETOLD * gram[-1, -1]:
        return True
    return bool(n * np.log(alone / max(both, FORETOLD * gram[-1, -1])) > ORDER * np.log(n))
