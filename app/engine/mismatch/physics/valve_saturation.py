"""Valve saturation: the stem meets a stop, or a limit in the positioner, before OP does. Hard, or rounded over a
width.
"""

from dataclasses import replace

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, Part, Sum, grid
from app.engine.mismatch.physics.corners import beyond_limit, limited_at
from app.engine.recording import BoolArray, FloatArray

_LEAST_WAY = 0.05


def _level(context: Context, sign: float) -> Parameter:
    op = context.record.op_deviation
    low, high = float(np.min(sign * op)), float(np.max(sign * op))
    edges = sorted((sign * (low + 0.1 * (high - low)), sign * high))
    return Parameter("limit", "OP level", edges[0], edges[1], context.record.op_span)


def _width(context: Context) -> Parameter:
    span = context.record.op_span
    return Parameter("width", "OP", 1e-3 * span, 0.3 * span, span, log=True)


def _levels(context: Context, sign: float, count: int) -> FloatArray:
    op = np.sort(sign * context.record.op_deviation)
    low, high = np.quantile(op, 0.15), op[-1]
    by_value = np.linspace(low, high, count, endpoint=False)
    by_share = np.quantile(op, np.linspace(0.3, 0.995, count))
    return sign * np.unique(np.concatenate((by_value, by_share)))


def _block(sign: float, soft: bool) -> Block:
    def parameters(context: Context) -> tuple[Parameter, ...]:
        return (_level(context, sign), _width(context)) if soft else (_level(context, sign),)

    def starts(context: Context, _: FloatArray) -> FloatArray:
        if soft:
            return grid(_levels(context, sign, 10), context.record.op_span * np.array([0.02, 0.06, 0.15]))
        return _levels(context, sign, 20)[:, None]

    side = "high" if sign > 0 else "low"
    condition = f"{'above' if sign > 0 else 'below'} an OP limit"
    return Block(
        "valve.saturation",
        "valve",
        "valve",
        condition,
        parameters,
        starts,
        apply=limited_at(sign),
        active=beyond_limit(sign),
        form=side + ("-soft" if soft else ""),
        penalty=17.0 if soft else 14.0,
    )


def _both_levels(context: Context) -> tuple[Parameter, ...]:
    high, low = _level(context, 1.0), _level(context, -1.0)
    return (replace(high, name="high"), replace(low, name="low"))


def _both_starts(context: Context, _: FloatArray) -> FloatArray:
    pairs = grid(_levels(context, 1.0, 8), _levels(context, -1.0, 8))
    return pairs[pairs[:, 0] > pairs[:, 1]]


def _between_both(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return np.minimum(np.maximum(signal, values[1]), values[0])


def _beyond_either(signal: FloatArray, values: FloatArray, _: Context) -> BoolArray:
    return (signal > values[0]) | (signal < values[1])


def _leave_a_way(values: FloatArray, context: Context) -> bool:
    """Limits that leave the stem nearly no way are no limits; one that OP never meets is another form's."""
    op = context.record.op_deviation
    return bool(
        values[0] - values[1] > _LEAST_WAY * context.record.op_span
        and np.any(op > values[0])
        and np.any(op < values[1])
    )


HIGH, _HIGH_SOFT, _LOW, _LOW_SOFT = (_block(sign, soft) for sign in (1.0, -1.0) for soft in (False, True))


def _either(points: FloatArray, _: Context) -> Sum:
    """What two limits take off is what each takes off, as long as one is above the other."""
    sides = (
        (HIGH, *np.unique(points[:, 0], return_inverse=True)),
        (_LOW, *np.unique(points[:, 1], return_inverse=True)),
    )
    pieces = (Part(block, np.array([limit])) for block, limits, _ in sides for limit in limits)
    weights = [np.eye(len(limits))[at] for _, limits, at in sides]
    return Sum(tuple(pieces), np.concatenate(weights, axis=1))


_BOTH = Block(
    "valve.saturation",
    "valve",
    "valve",
    "beyond OP limits",
    _both_levels,
    _both_starts,
    apply=_between_both,
    active=_beyond_either,
    form="both",
    penalty=17.0,
    sensible=_leave_a_way,
    sum_of=_either,
)
BLOCKS = (HIGH, _HIGH_SOFT, _LOW, _LOW_SOFT, _BOTH)
