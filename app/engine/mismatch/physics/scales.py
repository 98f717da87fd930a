"""The scales that blocks share: the size of what is added to PV, and the time that the process takes."""

from app.engine.mismatch.loop.block import Context, Parameter


def size(context: Context, name: str = "size") -> Parameter:
    """What is added to PV, of either sign; linear, its scale a tenth of PV's span."""
    span = context.record.pv_span
    return Parameter(name, "PV", -20.0 * span, 20.0 * span, 0.1 * span, linear=True)


def slowness(context: Context) -> float:
    """The slowest time of the linear plant, s."""
    plant = context.plant
    own = plant.tau if plant.leak > 0.0 else 0.0
    return max(own, plant.tau2, plant.theta, 2.0 * context.record.sampling_interval_s)
