"""What blocks that act in time share: their moments, what rises between two of them, and where they act."""

import numpy as np
from numba import njit

from app.engine.mismatch.loop.block import Block, Context, Parameter, Part, Sum
from app.engine.recording import BoolArray, FloatArray

_MOST_OF_START = 0.1
EDGE = 0.1  # of the record, and of what shows in it what sets in: so much before that moment, and after


def moment(name: str, context: Context) -> Parameter:
    return Parameter(name, "s", 0.0, context.record.duration_s, 0.2 * context.record.duration_s)


def stretches(moments: FloatArray, apart: int = 1) -> FloatArray:
    """(M, 3) the stretches from each of some moments, s in order, to those that are so many further on or more; of size
    0.
    """
    pairs = [(a, b, 0.0) for i, a in enumerate(moments) for b in moments[i + apart :]]
    return np.array(pairs).reshape(-1, 3)


def ramp(context: Context, begin_s: float, end_s: float) -> FloatArray:
    """0 before begin_s, 1 after end_s, straight between them; (N,)."""
    return _ramp(context.time_s, float(begin_s), max(float(end_s - begin_s), context.record.sampling_interval_s))


@njit(cache=True, nogil=True)
def _ramp(time_s: FloatArray, begin_s: float, lasting_s: float) -> FloatArray:
    share = np.empty(len(time_s))
    for t in range(len(time_s)):
        share[t] = min(max((time_s[t] - begin_s) / lasting_s, 0.0), 1.0)
    return share


def rise(context: Context, begin_s: float) -> FloatArray:
    """0 before begin_s, then straight up by 1 in as long as the record; (N,)."""
    return np.maximum(context.time_s - begin_s, 0.0) / context.record.duration_s


def jumps_at(block: Block, times: FloatArray, weights: FloatArray) -> Sum:
    """Points (M) as sums of what a block does from each of some moments on. times: (M, C) those moments, s: its first
    value, the only one that is not linear. weights: (M, C) or (C,) how much of each.
    """
    moments, at = np.unique(times, return_inverse=True)
    of_each = np.zeros((len(times), len(moments)))
    rows = np.arange(len(times))[:, None]
    np.add.at(of_each, (rows, at.reshape(times.shape)), np.broadcast_to(weights, times.shape))
    return Sum(tuple(Part(block, np.array([start, 0.0])) for start in moments), of_each)


def slopes_at(block: Block, begins: FloatArray, ends: FloatArray, context: Context) -> Sum:
    """Points (M) that go as `ramp` from begins to ends (M,), s, as sums of what goes as `rise` from a moment on."""
    lasting = np.maximum(ends - begins, context.record.sampling_interval_s)
    steep = context.record.duration_s / lasting
    return jumps_at(block, np.stack((begins, begins + lasting), axis=1), np.stack((steep, -steep), axis=1))


def added(one: Sum, other: Sum, share: float = 1.0) -> Sum:
    """The points of one sum with a share of those of another beside."""
    return Sum((*one.pieces, *other.pieces), np.concatenate((one.weights, share * other.weights), axis=1))


def since(_: FloatArray, values: FloatArray, context: Context) -> BoolArray:
    """(N,) True from a block's first value on, a moment in s."""
    return context.time_s >= values[0]


def between(_: FloatArray, values: FloatArray, context: Context) -> BoolArray:
    """(N,) True from a block's first value up to, not at, its second, moments in s."""
    return (context.time_s >= values[0]) & (context.time_s < values[1])


def inside(at_s: float, context: Context) -> bool:
    """Whether a moment is apart from both ends of the record: from its start by as long as the states that the process
    began with still show, which are fitted for its first lag alone.
    """
    record, plant = context.record, context.plant
    margin = 8.0 * record.sampling_interval_s
    shows = plant.theta + plant.tau2 + (plant.tau if plant.leak > 0.0 else 0.0)
    begun = max(margin, min(shows, _MOST_OF_START * record.duration_s))
    return begun <= at_s <= record.duration_s - margin


def amid(at_s: float, shows: FloatArray, context: Context) -> bool:
    """Whether the record goes on for long enough before a moment and after it, and what sets in then would have shown
    (N,) before it too, had it been there: where OP rests before, it may have been there all along.
    """
    duration = context.record.duration_s
    if not EDGE * duration <= at_s <= (1.0 - EDGE) * duration:
        return False
    before = float(np.sum(shows[context.time_s < at_s]))
    return EDGE <= before / max(float(np.sum(shows)), 1e-300) <= 1.0 - EDGE
