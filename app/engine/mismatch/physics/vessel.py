"""What a vessel does that a lag does not: it overflows or runs empty, and it empties by the square root of its level
(Torricelli).
"""

import numpy as np

from app.engine.mismatch.block import Block, Context, Parameter
from app.engine.mismatch.plant import Plant
from app.engine.recording import BoolArray, FloatArray


def _level(context: Context, sign: float) -> Parameter:
    pv = sign * context.record.pv_deviation
    low, high = float(np.quantile(pv, 0.2)), float(np.max(pv))
    edges = sorted((sign * low, sign * (high + 0.02 * (high - low))))
    return Parameter("limit", "PV level", edges[0], edges[1], context.record.pv_span)


def _overflow(sign: float) -> Block:
    def parameters(context: Context) -> tuple[Parameter, ...]:
        return (_level(context, sign),)

    def starts(context: Context, _: FloatArray) -> FloatArray:
        pv = sign * context.record.pv_deviation
        return sign * np.quantile(pv, np.linspace(0.4, 1.0, 25))[:, None]

    def alter(plant: Plant, values: FloatArray, _: Context) -> Plant:
        return plant.changed(high=float(values[0])) if sign > 0 else plant.changed(low=float(values[0]))

    def active(signal: FloatArray, values: FloatArray, context: Context) -> BoolArray:
        return sign * signal >= sign * values[0] - 1e-6 * context.record.pv_span

    side, condition = ("high", "at high level") if sign > 0 else ("low", "at low level")
    return Block(
        "process.overflow",
        "process",
        "process",
        condition,
        parameters,
        starts,
        alter=alter,
        active=active,
        form=side,
        penalty=11.0,
    )


def head(context: Context) -> tuple[Parameter, ...]:
    lowest = float(-np.min(context.record.pv_deviation))
    return (Parameter("head", "PV", 0.6 * lowest, 100.0 * context.record.pv_span, context.record.pv_span, log=True),)


def heads(context: Context, _: FloatArray) -> FloatArray:
    lowest = float(-np.min(context.record.pv_deviation))
    return np.geomspace(0.9 * lowest, 12.0 * lowest, 10)[:, None]


def outflow(plant: Plant, values: FloatArray, _: Context) -> Plant:
    return plant.changed(head=float(values[0]))


BLOCKS = (
    _overflow(1.0),
    _overflow(-1.0),
    Block(
        "process.outflow_law",
        "process",
        "process",
        "at another level",
        head,
        heads,
        alter=outflow,
        penalty=10.5,
        frees_gain=True,
    ),
)
