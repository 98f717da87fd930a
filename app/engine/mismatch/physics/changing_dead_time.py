"""A dead time that becomes another one: a belt that slows down, a line that fills up, a sampling pump that tires."""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.loop.plant import delay
from app.engine.mismatch.physics.moments import moment, since
from app.engine.mismatch.physics.process_dynamics import extra_delay
from app.engine.mismatch.physics.scales import slowness
from app.engine.recording import FloatArray

EDGE = 0.1  # of the record, and of what shows the dead time in it: so much before it changes, and after
CODE = "process.dead_time"


def delays(context: Context) -> FloatArray:
    return np.geomspace(context.record.sampling_interval_s, 4.0 * slowness(context), 10)


def later(signal: FloatArray, extra_s: FloatArray, context: Context) -> FloatArray:
    """The signal (N,), each sample of it from extra_s (N,) seconds before."""
    time_s = context.time_s
    return np.interp(time_s - extra_s, time_s, signal)


def sets_in_parameters(context: Context) -> tuple[Parameter, ...]:
    return (moment("start", context), *extra_delay(context))


def sets_in_starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.duration_s * np.linspace(EDGE, 1.0 - EDGE, 17), delays(context))


def sets_in(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """Longer from the start on: what is on its way then has been on it for as long already."""
    return later(signal, np.where(context.time_s >= values[0], values[1], 0.0), context)


def seen_on_both_sides(values: FloatArray, context: Context) -> bool:
    """Whether the record goes on for long enough before and after, and OP moves so much in both that the longer dead
    time would show: where it rests before, the dead time may have been as long all along.
    """
    duration, start = context.record.duration_s, values[0]
    if not EDGE * duration <= start <= (1.0 - EDGE) * duration:
        return False
    op = context.record.op_deviation
    shows = (delay(op, values[1], context.record.sampling_interval_s) - op) ** 2
    before = float(np.sum(shows[context.time_s < start]))
    return EDGE <= before / max(float(np.sum(shows)), 1e-300) <= 1.0 - EDGE


def grows_starts(context: Context, _: FloatArray) -> FloatArray:
    return delays(context)[:, None]


def grows(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """Longer and longer, from nothing at the record's start."""
    return later(signal, values[0] * context.time_s / context.record.duration_s, context)


BLOCKS = (
    Block(
        CODE,
        "process",
        "input",
        "after a time",
        sets_in_parameters,
        sets_in_starts,
        apply=sets_in,
        active=since,
        form="sets_in",
        penalty=17.0,
        rough=True,
        abrupt=True,
        sensible=seen_on_both_sides,
    ),
    Block(
        CODE,
        "process",
        "input",
        "longer and longer",
        extra_delay,
        grows_starts,
        apply=grows,
        form="grows",
        penalty=15.0,
    ),
)
