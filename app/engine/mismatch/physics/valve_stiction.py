"""Valve stiction: the stem holds until OP has overcome static friction, then slips. Models and sources in
`app.engine.valve`.
"""

import numpy as np

from app.engine.mismatch.block import Block, Context, Parameter, grid
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
    )


def starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.op_span * np.geomspace(0.02, 1.2, 26), np.array([0.1, 0.3, 0.5, 0.7, 0.9, 1.0]))


def he(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    S, share = values
    return two_parameter_he(signal, np.array([S]), np.array([S * share]))[0]


def choudhury(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    S, share = values
    return two_parameter_choudhury(signal, np.array([S]), np.array([S * share]))[0]


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
        penalty=18.0,
        rough=True,
        finalists=4,
    )
    for form, model in (("he", he), ("choudhury", choudhury))
)
