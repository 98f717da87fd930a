"""A dead time that becomes another one: a belt that slows down, a line that fills up, a sampling pump that tires."""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.loop.plant import delay
from app.engine.mismatch.physics.moments import EDGE, amid, moment, since
from app.engine.mismatch.physics.process_dynamics import extra_delay
from app.engine.mismatch.physics.scales import slowness
from app.engine.recording import FloatArray

_CODE = "process.dead_time"


def _delays(context: Context) -> FloatArray:
    return np.geomspace(context.record.sampling_interval_s, 4.0 * slowness(context), 10)


def _later(signal: FloatArray, extra_s: FloatArray, context: Context) -> FloatArray:
    """The signal (N,), each sample of it from extra_s (N,) seconds before."""
    time_s = context.time_s
    return np.interp(time_s - extra_s, time_s, signal)


def _sets_in_parameters(context: Context) -> tuple[Parameter, ...]:
    return (moment("start", context), *extra_delay(context))


def _sets_in_starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.duration_s * np.linspace(EDGE, 1.0 - EDGE, 17), _delays(context))


def _sets_in(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """Longer from the start on: what is on its way then has been on it for as long already."""
    return _later(signal, np.where(context.time_s >= values[0], values[1], 0.0), context)


def _seen_on_both_sides(values: FloatArray, context: Context) -> bool:
    """Whether OP moves so much before the moment and after it that the longer dead time would show in both."""
    op = context.record.op_deviation
    shows = (delay(op, values[1], context.record.sampling_interval_s) - op) ** 2
    return amid(float(values[0]), shows, context)


def _grows_starts(context: Context, _: FloatArray) -> FloatArray:
    return _delays(context)[:, None]


def _grows(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """Longer and longer, from nothing at the record's start."""
    return _later(signal, values[0] * np.minimum(context.time_s / context.record.reference_duration_s, 1.0), context)


BLOCKS = (
    Block(
        _CODE,
        "process",
        "input",
        "after a time",
        _sets_in_parameters,
        _sets_in_starts,
        apply=_sets_in,
        active=since,
        affine=True,
        form="sets_in",
        penalty=17.0,
        rough=True,
        abrupt=True,
        sensible=_seen_on_both_sides,
    ),
    Block(
        _CODE,
        "process",
        "input",
        "longer and longer",
        extra_delay,
        _grows_starts,
        apply=_grows,
        affine=True,
        form="grows",
        penalty=15.0,
    ),
)
