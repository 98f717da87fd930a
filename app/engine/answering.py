"""Whether PV answers OP: whether it is held while loads would carry it away, or OP foretells what it does next.

Behind a valve that stands fast PV goes its own way, and OP, which a controller makes of PV, follows it: the two look as
much alike as in a loop at work, and such a loop hardly cycles.
"""

import numpy as np

from app.engine.fitness.signals import standing
from app.engine.recording import BoolArray, FloatArray, UniformRecord
from app.engine.sampled import blocks, slow_share, unlike

STANDING = 300
"""Samples in a row of one value that show nothing of a loop at work: where a unit is shut down PV and OP fall together.
"""

SHORTEST_BLOCK, FEWEST_BLOCKS = 16, 8
HELD = 0.93
"""Share of the variance of PV that lies between blocks of any length, at most: what is held comes back within some.
Chosen on simulated loads that wander (`testbench.days --process slow`), so that loops tuned up to four times as
sluggishly as usual pass.
"""

ORDER = 8
STRIDES = (16, 8, 4, 2, 1)
"""Samples that are averaged into one, the coarsest first: a quick loop answers within some of them, a slow one within
some of the coarsest."""

RIDGE = 1e-10
FORETOLD = 1e-8
"""Share of the variance of PV below which it foretells itself but for rounding: nothing can add to that."""
FEWEST = 12 * ORDER
FAR = 7.5
"""Times the median miss: five standard deviations of a normal one."""


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
    """Whether the last ORDER means of OP add to what PV's own past foretells of its next one, by more than their number
    is worth (Bayesian information criterion).

    PV's own past: its last ORDER means, and what it was lately, within the last of them: a controller has seen that,
    and OP would tell it. Of all samples, or of all but those that PV's past misses by far: an upset may hide everything
    else, a step of the set point shows it. Source: Granger 1969, Investigating causal relations by econometric models
    and cross-spectral methods, doi 10.2307/1912791; Schwarz 1978, Estimating the dimension of a model,
    doi 10.1214/aos/1176344136.
    """
    pv, op = blocks(record.pv, stride), blocks(record.op, stride).mean(axis=1)
    if len(op) <= ORDER:
        return False
    mean = pv.mean(axis=1)
    lately = [_at_unit(pv[:, -k:].mean(axis=1))[ORDER - 1 : -1] for k in _within(stride)]
    own = [np.ones(len(op) - ORDER), _past(mean), *lately]
    touched = np.lib.stride_tricks.sliding_window_view(blocks(stands, stride).any(axis=1), ORDER + 1).any(axis=1)
    columns = np.column_stack((*own, _past(op), _at_unit(mean)[ORDER:]))[~touched]
    if len(columns) < FEWEST:
        return False
    terms = columns.shape[1] - ORDER - 1
    missed = np.abs(columns[:, -1] - columns[:, :terms] @ _fitted(columns.T @ columns, terms))
    return _adds(columns) or _adds(columns[missed <= FAR * float(np.median(missed))])


def _within(stride: int) -> list[int]:
    """1, 2, 4 .. below stride."""
    return [2**k for k in range(stride.bit_length()) if 2**k < stride]


def _past(x: FloatArray) -> FloatArray:
    """(n - ORDER, ORDER): the values before each of x (n,) but the first ones, at unit deviation."""
    return np.lib.stride_tricks.sliding_window_view(_at_unit(x)[:-1], ORDER)


def _at_unit(x: FloatArray) -> FloatArray:
    return (x - x.mean()) / (float(x.std()) or 1.0)


def _adds(columns: FloatArray) -> bool:
    """columns: (n, terms): ones and the past of PV, ORDER of the past of OP, and what PV is next."""
    n, terms = columns.shape
    if n < FEWEST:
        return False
    gram = columns.T @ columns
    alone, both = _left_over(gram, terms - ORDER - 1), _left_over(gram, terms - 1)
    if alone <= FORETOLD * gram[-1, -1]:
        return True
    return bool(n * np.log(alone / max(both, FORETOLD * gram[-1, -1])) > ORDER * np.log(n))


def _left_over(gram: FloatArray, terms: int) -> float:
    """Sum of squares of what the first columns do not explain of the last one."""
    weights, among, along = _fitted(gram, terms), gram[:terms, :terms], gram[:terms, -1]
    return float(gram[-1, -1] - 2.0 * along @ weights + weights @ among @ weights)


def _fitted(gram: FloatArray, terms: int) -> FloatArray:
    """(terms,) weights of the first columns that explain the last one best."""
    among = gram[:terms, :terms] + RIDGE * gram[0, 0] * np.eye(terms)
    return np.asarray(np.linalg.solve(among, gram[:terms, -1]))
