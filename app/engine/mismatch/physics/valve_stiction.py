"""Valve stiction: the stem holds until OP has overcome static friction, then slips. Models and sources in
`app.engine.valve`.
"""

import numpy as np

from app.engine.mismatch.block import Block, Context, Parameter, grid
from app.engine.mismatch.physics.stem import PENALTY, START, first_position
from app.engine.recording import FloatArray
from app.engine.valve import two_parameter_choudhury, two_parameter_he


def parameters(context: Context) -> tuple[Parameter, ...]:
    """S within the range over which OP moved: behind a wider band no reversal of the record could have moved the stem.
    J is a share of S, and with it within that range.
    """
    span = context.record.op_span
    return (
        Parameter("S", "OP", 0.003 * span, context.record.op_range, span, log=True),
        Parameter("share", "J/S", 0.0, 1.0, 1.0),
        START,
    )


def starts(context: Context, _: FloatArray) -> FloatArray:
    shares = np.array([0.1, 0.3, 0.5, 0.7, 0.9, 1.0])
    return grid(context.record.op_span * np.geomspace(0.02, 1.2, 26), shares, np.zeros(1))


def stem(signal: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """S, J and the stem's first position, (1,) each, unit of OP."""
    S, J = float(values[0]), float(values[0] * values[1])
    start = first_position(float(signal[0]), values, 2, 0.5 * (S + J))
    return np.array([S]), np.array([J]), np.array([start])


def slipping_as(values: FloatArray, share: float) -> list[FloatArray]:
    """The numbers (3,) of stems with another slip, J / S = `share`, that slip first where the stem of `values` does,
    downwards or upwards: the distance from where it stood to where it lets go, (1 -+ start) (S + J) / 2, is the same.

    All later slips hang on S alone as long as OP does not go on in one direction by more than J, and what a record then
    tells is J times the gain: along these numbers the likelihood is flat, across them it jumps.
    """
    longer = (1.0 + values[1]) / (1.0 + share)
    starts = [side * (1.0 - (1.0 - side * values[2]) * longer) for side in (1.0, -1.0)]
    return [np.array([values[0], share, start]) for start in starts if abs(start) <= 1.0]


def he(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return two_parameter_he(signal, *stem(signal, values))[0]


def choudhury(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return two_parameter_choudhury(signal, *stem(signal, values))[0]


BLOCKS = tuple(
    Block(
        "valve.stiction",
        "valve",
        "valve",
        "after OP reversals",
        parameters,
        starts,
        apply=model,
        form=form,
        penalty=18.0 + PENALTY,
        rough=True,
        finalists=4,
    )
    for form, model in (("he", he), ("choudhury", choudhury))
)
