"""Deadband (backlash): after a reversal the stem waits until OP has crossed the band. He's model with J = 0."""

import numpy as np

from app.engine.mismatch.block import Block, Context, Parameter
from app.engine.recording import FloatArray
from app.engine.valve import two_parameter_he


def parameters(context: Context) -> tuple[Parameter, ...]:
    """The band within the range over which OP moved: in a wider one the stem would have stood still."""
    span = context.record.op_span
    return (Parameter("band", "OP", 0.003 * span, context.record.op_range, span, log=True),)


def starts(context: Context, _: FloatArray) -> FloatArray:
    return context.record.op_span * np.geomspace(0.01, 1.0, 40)[:, None]


def backlash(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return two_parameter_he(signal, values, np.zeros(1))[0]


BLOCKS = (
    Block(
        "valve.deadband",
        "valve",
        "valve",
        "after OP reversals",
        parameters,
        starts,
        apply=backlash,
        penalty=15.0,
        rough=True,
    ),
)
