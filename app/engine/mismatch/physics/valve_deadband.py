"""Deadband (backlash): after a reversal the stem waits until OP has crossed the band. He's model with J = 0."""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.physics.stem import PENALTY, START, first_position
from app.engine.recording import FloatArray
from app.engine.valve import he_stem


def parameters(context: Context) -> tuple[Parameter, ...]:
    """The band within the range over which OP moved: in a wider one the stem would have stood still."""
    span = context.record.op_span
    return (Parameter("band", "OP", 0.003 * span, context.record.op_range, span, log=True), START)


def starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.op_span * np.geomspace(0.01, 1.0, 40), np.zeros(1))


def backlash(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    band = float(values[0])
    start = first_position(float(signal[0]), values, 1, 0.5 * band)
    return he_stem(np.ascontiguousarray(signal), band, 0.0, start)


BLOCKS = (
    Block(
        "valve.deadband",
        "valve",
        "valve",
        "after OP reversals",
        parameters,
        starts,
        apply=backlash,
        penalty=15.0 + PENALTY,
        rough=True,
    ),
)
