"""Where a stem that sticks stood when the record began: anywhere in its band, and nobody recorded it.

Until OP first moves it the flow is off by that much all the time, which looks like a step of the load or of the sensor.
"""

from app.engine.mismatch.loop.block import Context, Parameter
from app.engine.recording import FloatArray

NAME = "stem_start"
START = Parameter(NAME, "share of band", -1.0, 1.0, begins=True)
PENALTY = 0.5  # nat: what one number more gains on average where it says nothing, and what it did on 40 clean loops


def start_of_travel(context: Context) -> Parameter:
    """How far from OP a slow stem began, on its way there."""
    most = context.record.op_range
    return Parameter(NAME, "OP", -most, most, context.record.op_span, begins=True)


def first_position(first: float, values: FloatArray, at: int, reach: float) -> float:
    """The stem's position when the record begins, unit of OP: `first`, where OP is, and the share of its reach to
    either side that stands at `at`. Models exported before it was fitted do not have it, and began at OP.
    """
    share = min(max(float(values[at]), -1.0), 1.0) if len(values) > at else 0.0
    return first + share * reach
