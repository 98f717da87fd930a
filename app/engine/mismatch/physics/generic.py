"""Terms that name nothing: slow and fast answers to OP, straight and bent; for where no named physics comes near."""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter
from app.engine.mismatch.loop.plant import delay, lag
from app.engine.mismatch.physics.scales import slowness
from app.engine.recording import FloatArray

CODE = "unnamed"
SPEEDS = (0.3, 1.0, 3.0, 10.0)
_POWERS = (2, 3, 4)


def _dynamic_parameters(context: Context) -> tuple[Parameter, ...]:
    most = 20.0 * context.record.pv_span
    scale = 0.1 * context.record.pv_span
    return tuple(Parameter(f"lag_{speed:g}", "PV", -most, most, scale, linear=True) for speed in SPEEDS)


def _static_parameters(context: Context) -> tuple[Parameter, ...]:
    most = 20.0 * context.record.pv_span
    scale = 0.1 * context.record.pv_span
    return tuple(Parameter(f"power_{power}", "PV", -most, most, scale, linear=True) for power in _POWERS)


def _zeros(count: int) -> FloatArray:
    return np.zeros((1, count))


def acting(u: FloatArray, context: Context) -> FloatArray:
    """A drive u (N,) as it reaches PV: after the dead time, and where a controller set it a sample later.

    A controller sets OP from the PV of the same sample. A term that answers at once undoes the controller's law and
    copies PV, noise included. Where none is in OP, as in an experiment, the process may answer within a sample.
    """
    ts = context.record.sampling_interval_s
    return delay(u, context.plant.theta + (ts if context.record.fed_back else 0.0), ts)


def _dynamic(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """Four lags of OP beside the model: whatever linear memory it lacks; the signal itself where they weigh nothing."""
    ts, u = context.record.sampling_interval_s, context.record.op_deviation / context.record.op_span
    late, slow, out = acting(u, context), slowness(context), signal
    for value, speed in zip(values.tolist(), SPEEDS, strict=True):
        if value != 0.0:
            out = out + value * lag(late, speed * slow, ts)
    return out


def _static(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """Powers of OP behind the process lag: whatever curve it lacks; one delay and one lag pass them all."""
    ts, u = context.record.sampling_interval_s, context.record.op_deviation / context.record.op_span
    curve: FloatArray = np.polynomial.polynomial.polyval(u, np.concatenate((np.zeros(_POWERS[0]), values))).astype(
        float
    )
    return signal + lag(acting(curve, context), slowness(context), ts)


DYNAMIC = Block(
    CODE,
    "process",
    "output",
    "while OP moves: dynamic, additive, with memory",
    _dynamic_parameters,
    lambda _, __: _zeros(len(SPEEDS)),
    apply=_dynamic,
    form="dynamic",
    penalty=42.0,
)
_STATIC = Block(
    CODE,
    "process",
    "output",
    "at another operating point: static, behind the lag",
    _static_parameters,
    lambda _, __: _zeros(len(_POWERS)),
    apply=_static,
    form="static",
    penalty=42.0,
    frees_gain=True,
)
BLOCKS = (DYNAMIC, _STATIC)
