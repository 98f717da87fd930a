"""Deadband (backlash): after a reversal the stem waits until OP has crossed the band. He's model with J = 0. Where the
valve wears, the band becomes wider along the record.
"""

from dataclasses import replace

import numpy as np
from numba import njit

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.physics.stem import PENALTY, START, first_position
from app.engine.recording import FloatArray
from app.engine.valve import he_stem

_MOST_AT_FIRST = 0.7  # of the last band: beyond, it is one band as well


def _parameters(context: Context) -> tuple[Parameter, ...]:
    """The band within the range over which OP moved: in a wider one the stem would have stood still."""
    span = context.record.op_span
    return (Parameter("band", "OP", 0.003 * span, context.record.op_range, span, log=True), START)


def _starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.op_span * np.geomspace(0.01, 1.0, 40), np.zeros(1))


def _backlash(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    band = float(values[0])
    start = first_position(float(signal[0]), values, 1, 0.5 * band)
    return he_stem(np.ascontiguousarray(signal), band, 0.0, start)


def _grows_parameters(context: Context) -> tuple[Parameter, ...]:
    """The band at the record's end, the share of it that it began with, and where the stem stood in that."""
    return (_parameters(context)[0], Parameter("share_at_first", "share of band", 0.0, _MOST_AT_FIRST), START)


def _grows_starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.op_span * np.geomspace(0.03, 1.0, 16), np.array([0.0, 0.4]), np.zeros(1))


def grows(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """The band goes straight from its first width to its last over the record."""
    band, share = values[:2].tolist()
    half = 0.5 * band * (share + (1.0 - share) * np.minimum(context.time_s / context.record.reference_duration_s, 1.0))
    return _within(signal, half, first_position(float(signal[0]), values, 2, float(half[0])))


@njit(cache=True, nogil=True)
def _within(op: FloatArray, half: FloatArray, x: float) -> FloatArray:
    v = np.empty(len(op))
    for t in range(len(op)):
        x = v[t] = min(max(x, op[t] - half[t]), op[t] + half[t])
    return v


DEADBAND = Block(
    "valve.deadband",
    "valve",
    "valve",
    "after OP reversals",
    _parameters,
    _starts,
    apply=_backlash,
    penalty=15.0 + PENALTY,
    rough=True,
)
_GROWS = replace(
    DEADBAND,
    condition="after OP reversals, more and more",
    parameters=_grows_parameters,
    starts=_grows_starts,
    apply=grows,
    form="grows",
    penalty=17.0 + PENALTY,
)
BLOCKS = (DEADBAND, _GROWS)
