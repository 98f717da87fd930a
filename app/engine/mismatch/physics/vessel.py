"""What a vessel does that a lag does not: it overflows or runs empty, and it empties by the square root of its level
(Torricelli), or over a weir by a power of it above 1: 3/2 where that is rectangular, 5/2 where it is a notch
(ISO 1438).
"""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.loop.plant import Plant, delay
from app.engine.mismatch.physics.scales import depth
from app.engine.recording import BoolArray, FloatArray

OVERFLOW = "process.overflow"
_CLEAR = 2.0
_WEIR, _NOTCH = 1.5, 2.5


def _level(context: Context, sign: float) -> Parameter:
    pv = sign * context.record.pv_deviation
    low, high = float(np.quantile(pv, 0.2)), float(np.max(pv))
    edges = sorted((sign * low, sign * (high + 0.02 * (high - low))))
    return Parameter("limit", "PV level", edges[0], edges[1], context.record.pv_span)


def balance_beside(context: Context, sign: float, level: float) -> float:
    """What the offset of an integrator changes (PV/s) if PV moves by OP alone wherever it is clear of this level: there
    its mean speed is K u + b.
    """
    record, plant = context.record, context.plant
    ts, pv = record.sampling_interval_s, sign * record.pv_deviation
    clear = record.usable & (pv < sign * level - _CLEAR * float(np.std(np.diff(pv))))
    clear = clear[1:] & clear[:-1]
    if not clear.any():
        return 0.0
    u = delay(record.op_deviation, plant.theta + plant.tau2, ts)
    speed = float(np.mean(np.diff(record.pv_deviation)[clear])) / ts
    return speed - plant.K * float(np.mean(u[:-1][clear])) - plant.b


def _overflow(sign: float) -> Block:
    def parameters(context: Context) -> tuple[Parameter, ...]:
        if context.plant.leak > 0.0:
            return (_level(context, sign),)
        reach = abs(context.plant.K) * context.record.op_span
        return (_level(context, sign), Parameter("balance", "PV/s", -2.0 * reach, 2.0 * reach, reach))

    def starts(context: Context, _: FloatArray) -> FloatArray:
        pv = sign * context.record.pv_deviation
        levels = sign * np.quantile(pv, np.linspace(0.4, 1.0, 25))
        if context.plant.leak > 0.0:
            return levels[:, None]
        # While an integrator runs over, OP winds up: its mean says nothing of the OP that holds the level.
        tried = grid(levels[::2], abs(context.plant.K) * context.record.op_span * np.linspace(-0.8, 0.8, 9))
        free = [(level, balance_beside(context, sign, level)) for level in levels[::2]]
        return np.concatenate((tried, np.array(free)))

    def alter(plant: Plant, values: FloatArray, _: Context) -> Plant:
        b = plant.b + (float(values[1]) if len(values) > 1 else 0.0)
        return plant.changed(high=float(values[0]), b=b) if sign > 0 else plant.changed(low=float(values[0]), b=b)

    def active(signal: FloatArray, values: FloatArray, context: Context) -> BoolArray:
        # Behind a second lag PV only nears the limit.
        near = 0.03 if context.plant.tau2 > 0.0 and context.plant.leak > 0.0 else 1e-6
        return sign * signal >= sign * values[0] - near * context.record.pv_span

    side, condition = ("high", "at high level") if sign > 0 else ("low", "at low level")
    return Block(
        OVERFLOW,
        "process",
        "process",
        condition,
        parameters,
        starts,
        alter=alter,
        active=active,
        form=side,
        penalty=14.5,
        distant=True,
    )


def _head(context: Context) -> tuple[Parameter, ...]:
    lowest = depth(context)
    return (Parameter("head", "PV", 0.6 * lowest, 100.0 * context.record.pv_span, context.record.pv_span, log=True),)


def _heads(context: Context, _: FloatArray) -> FloatArray:
    lowest = depth(context)
    return np.geomspace(0.9 * lowest, 12.0 * lowest, 10)[:, None]


def _outflow(plant: Plant, values: FloatArray, _: Context) -> Plant:
    return plant.changed(head=float(values[0]))


def _crest(context: Context) -> tuple[Parameter, ...]:
    """How far the weir's crest is below the working point, and the power of the height above it."""
    return (*_head(context), Parameter("exponent", "1", 1.2, 3.0, _WEIR, log=True, deviation=0.4))


def _crests(context: Context, _: FloatArray) -> FloatArray:
    return grid(np.geomspace(0.9, 6.0, 6) * depth(context), np.array([_WEIR, _NOTCH]))


def _over_weir(plant: Plant, values: FloatArray, _: Context) -> Plant:
    return plant.changed(head=float(values[0]), exponent=float(values[1]))


BLOCKS = (
    _overflow(1.0),
    _overflow(-1.0),
    Block(
        "process.outflow_law",
        "process",
        "process",
        "at another level",
        _head,
        _heads,
        alter=_outflow,
        penalty=14.0,
        frees_gain=True,
    ),
    Block(
        "process.outflow_law",
        "process",
        "process",
        "at another level",
        _crest,
        _crests,
        alter=_over_weir,
        form="weir",
        penalty=16.5,
        frees_gain=True,
    ),
)
