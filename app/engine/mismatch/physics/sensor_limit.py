"""Sensor saturation: the transmitter stops at the end of its range, whatever the process does beyond it."""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter
from app.engine.mismatch.physics.corners import beyond_limit, limited_at
from app.engine.recording import FloatArray

CODE = "sensor.saturation"


def _block(sign: float, soft: bool) -> Block:
    def parameters(context: Context) -> tuple[Parameter, ...]:
        pv, span = sign * context.record.pv_deviation, context.record.pv_span
        edges = sorted((sign * float(np.quantile(pv, 0.2)), sign * (float(np.max(pv)) + 0.02 * span)))
        limit = Parameter("limit", "PV level", edges[0], edges[1], span)
        return (limit, Parameter("width", "PV", 1e-3 * span, 0.3 * span, span, log=True)) if soft else (limit,)

    def starts(context: Context, _: FloatArray) -> FloatArray:
        levels = sign * np.quantile(sign * context.record.pv_deviation, np.linspace(0.4, 1.0, 20))
        if soft:
            return np.array([(v, w * context.record.pv_span) for v in levels[::2] for w in (0.03, 0.1)])
        return levels[:, None]

    side = "high" if sign > 0 else "low"
    return Block(
        CODE,
        "sensor",
        "sensor",
        "above a PV limit" if sign > 0 else "below a PV limit",
        parameters,
        starts,
        apply=limited_at(sign),
        active=beyond_limit(sign),
        form=side + ("-soft" if soft else ""),
        penalty=17.0 if soft else 15.0,
    )


BLOCKS = tuple(_block(sign, soft) for sign in (1.0, -1.0) for soft in (False, True))
