"""Linear dynamics that the simulation lacks: dead time, a further lag, an integrator, an inverse response."""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics.scales import slowness
from app.engine.recording import FloatArray

_LEAST_ZERO = 0.1


def extra_delay(context: Context) -> tuple[Parameter, ...]:
    ts = context.record.sampling_interval_s
    return (Parameter("extra", "s", 0.3 * ts, 6.0 * slowness(context), ts, log=True),)


def _delays(context: Context, _: FloatArray) -> FloatArray:
    return np.geomspace(0.5 * context.record.sampling_interval_s, 4.0 * slowness(context), 24)[:, None]


def _later(plant: Plant, values: FloatArray, _: Context) -> Plant:
    return plant.changed(theta=plant.theta + values[0])


def _lag_time(context: Context) -> tuple[Parameter, ...]:
    ts = context.record.sampling_interval_s
    return (Parameter("tau", "s", 0.3 * ts, 10.0 * slowness(context), ts, log=True),)


def _lags(context: Context, _: FloatArray) -> FloatArray:
    return np.geomspace(0.5 * context.record.sampling_interval_s, 5.0 * slowness(context), 16)[:, None]


def _lagged(plant: Plant, values: FloatArray, _: Context) -> Plant:
    return plant.changed(tau3=float(np.hypot(plant.tau3, values[0])))


def _nothing(_: Context) -> tuple[Parameter, ...]:
    return ()


def _only_start(_: Context, __: FloatArray) -> FloatArray:
    return np.zeros((1, 0))


def settles(context: Context) -> bool:
    """Whether the process is not known to integrate already: then the names would only free its gain, or add a leak."""
    return context.plant.leak > 0.0


def _integrating(plant: Plant, _: FloatArray, __: Context) -> Plant:
    return plant.changed(leak=0.0)


def _leak(_: Context) -> tuple[Parameter, ...]:
    return (Parameter("leak", "share", 0.0, 0.4, 1.0),)


def _leaks(_: Context, __: FloatArray) -> FloatArray:
    return np.array([[0.02], [0.1], [0.2]])


def _leaking(plant: Plant, values: FloatArray, _: Context) -> Plant:
    return plant.changed(leak=float(values[0]))


def _zero_and_lag(context: Context) -> tuple[Parameter, ...]:
    ts, slow = context.record.sampling_interval_s, slowness(context)
    return (
        Parameter("zero", "s", 0.2 * ts, 10.0 * slow, ts, log=True),
        Parameter("lag", "s", 0.05 * ts, 5.0 * slow, ts, log=True),
    )


def _zeros_and_lags(context: Context, _: FloatArray) -> FloatArray:
    ts, slow = context.record.sampling_interval_s, slowness(context)
    return grid(np.geomspace(0.5 * ts, 3.0 * slow, 7), np.geomspace(0.2 * ts, 1.5 * slow, 5))


def inverse(plant: Plant, values: FloatArray, context: Context) -> Plant:
    """(1 - zero s) / (lag s + 1): a fast path against a slow one; without the lag PV would jump with OP. Behind a
    single lag it is the second one, exactly: one that is put behind the zero takes the jumps before it for ramps.
    """
    zero, behind = values.tolist()
    # The given plant's leak: what else takes it away may come before this or after.
    if context.plant.leak > 0.0 and plant.tau2 == plant.damping == 0.0:
        return plant.changed(zero=zero, tau2=behind)
    return plant.changed(zero=zero, tau3=float(np.hypot(plant.tau3, behind)))


def _turns_back(values: FloatArray, context: Context) -> bool:
    """A zero far below the lag beside it, or below the interval, turns nothing back: that is a lag."""
    return bool(values[0] > max(_LEAST_ZERO * values[1], 0.3 * context.record.sampling_interval_s))


ALWAYS = "while OP moves"
EXTRA_LAG = Block("process.extra_lag", "process", "process", ALWAYS, _lag_time, _lags, alter=_lagged, penalty=13.0)
INVERSE_RESPONSE = Block(
    "process.inverse_response",
    "process",
    "process",
    ALWAYS,
    _zero_and_lag,
    _zeros_and_lags,
    alter=inverse,
    penalty=18.0,
    sensible=_turns_back,
)
BLOCKS = (
    Block("process.dead_time", "process", "process", ALWAYS, extra_delay, _delays, alter=_later, penalty=13.0),
    EXTRA_LAG,
    Block(
        "process.integrating",
        "process",
        "process",
        "always",
        _nothing,
        _only_start,
        alter=_integrating,
        penalty=13.0,
        frees_gain=True,
        suits=settles,
    ),
    Block(
        "process.integrating",
        "process",
        "process",
        "always",
        _leak,
        _leaks,
        alter=_leaking,
        form="leaky",
        penalty=18.0,
        suits=settles,
    ),
    INVERSE_RESPONSE,
)
