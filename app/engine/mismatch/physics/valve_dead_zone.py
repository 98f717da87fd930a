"""Dead zone: within a band of OP the valve (or the pump behind it) does not answer at all. Without memory, unlike a
deadband.

v = c + sgn(u - c) max(|u - c| - w / 2, 0), the band w around c. Source: Slotine, Li, Applied Nonlinear Control, 1991,
section 5.2.
"""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.recording import BoolArray, FloatArray


def _parameters(context: Context) -> tuple[Parameter, ...]:
    span = context.record.op_span
    low, high = np.quantile(context.record.op_deviation, (0.05, 0.95))
    return (
        Parameter("centre", "OP level", float(low), float(high), span),
        Parameter("band", "OP", 0.02 * span, 0.9 * span, span, log=True),
    )


def _starts(context: Context, _: FloatArray) -> FloatArray:
    centres = np.quantile(context.record.op_deviation, np.linspace(0.12, 0.88, 9))
    return grid(centres, context.record.op_span * np.array([0.06, 0.12, 0.25, 0.45]))


def _zone(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    off = signal - values[0]
    return values[0] + np.sign(off) * np.maximum(np.abs(off) - 0.5 * values[1], 0.0)


def _in_the_zone(signal: FloatArray, values: FloatArray, _: Context) -> BoolArray:
    return np.abs(signal - values[0]) < 0.5 * values[1]


BLOCKS = (
    Block(
        "valve.dead_zone",
        "valve",
        "valve",
        "within a band of OP",
        _parameters,
        _starts,
        apply=_zone,
        active=_in_the_zone,
        penalty=19.0,
        frees_gain=True,
    ),
)
