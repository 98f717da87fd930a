"""The scales that blocks share: the size of what is added to PV, and the time that the process takes."""

import numpy as np

from app.engine.mismatch.loop.block import Context, Parameter

LEAST_DEPTH = 0.01


def size(context: Context, name: str = "size") -> Parameter:
    """What is added to PV, of either sign; linear, its scale a tenth of PV's span."""
    span = context.record.pv_span
    return Parameter(name, "PV", -20.0 * span, 20.0 * span, 0.1 * span, linear=True)


def slowness(context: Context) -> float:
    """The slowest time of the linear plant, s."""
    plant = context.plant
    own = plant.tau if plant.leak > 0.0 else 0.0
    return max(own, plant.tau2, plant.tau3, plant.theta, 2.0 * context.record.sampling_interval_s)


def depth(context: Context) -> float:
    """How far PV goes below the working point, unit of PV: a vessel is at least as deep. A hundredth of PV's span where
    it stays above, as where the record has little of the plant's own steady state."""
    return max(float(-np.min(context.record.pv_deviation)), LEAST_DEPTH * context.record.pv_span)
