"""What is added to the loop: steps and ramps, of the load (behind the process lag) or of the sensor (at once), and
oscillations.
"""

import numpy as np

from app.engine.mismatch.block import Block, Context, Parameter
from app.engine.mismatch.physics.gain_drift import moment, ramp
from app.engine.mismatch.plant import lag
from app.engine.recording import BoolArray, FloatArray


def size(context: Context, name: str = "size") -> Parameter:
    span = context.record.pv_span
    return Parameter(name, "PV", -20.0 * span, 20.0 * span, 0.1 * span, linear=True)


def behind_lag(signal: FloatArray, context: Context) -> FloatArray:
    """A load's way to PV: the process lag, or where the process integrates, its sum over the slowest time seen."""
    ts, plant = context.record.sampling_interval_s, context.plant
    if plant.leak > 0.0:
        return lag(lag(signal, plant.tau, ts), plant.tau2, ts)
    return lag(np.cumsum(signal) * ts / context.record.duration_s * 10.0, plant.tau2, ts)


def step_parameters(context: Context) -> tuple[Parameter, ...]:
    return (moment("start", context), size(context))


def step_starts(context: Context, innovations: FloatArray) -> FloatArray:
    """Evenly spread moments, and those of the largest innovations: a jump of the sensor is one sample wide."""
    sharp = np.sort(np.argsort(-np.abs(innovations[5:]))[:20]) + 4
    even = np.linspace(0.015, 0.985, 110) * context.record.samples
    times = np.concatenate((sharp, even)) * context.record.sampling_interval_s
    return np.stack((times, np.zeros_like(times)), axis=1)


def sensor_step(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[1] * ramp(context, values[0], values[0])


def load_step(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[1] * behind_lag(ramp(context, values[0], values[0]), context)


def pulse_parameters(context: Context) -> tuple[Parameter, ...]:
    return (moment("start", context), moment("end", context), size(context))


def pulse_starts(context: Context, _: FloatArray) -> FloatArray:
    times = context.record.duration_s * np.linspace(0.02, 0.98, 25)
    return np.array([(a, b, 0.0) for i, a in enumerate(times) for b in times[i + 1 :]])


def pulse(context: Context, values: FloatArray) -> FloatArray:
    return ramp(context, values[0], values[0]) - ramp(context, values[1], values[1])


def sensor_pulse(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[2] * pulse(context, values)


def load_pulse(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[2] * behind_lag(pulse(context, values), context)


def drift_parameters(context: Context) -> tuple[Parameter, ...]:
    ts, duration = context.record.sampling_interval_s, context.record.duration_s
    return (
        moment("start", context),
        Parameter("lasting", "s", 10.0 * ts, 1.5 * duration, duration, log=True),
        size(context),
    )


def drift_starts(context: Context, _: FloatArray) -> FloatArray:
    return np.array([(a, b - a, 0.0) for a, b, _ in pulse_starts(context, _)])


def sensor_drift(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[2] * ramp(context, values[0], values[0] + values[1])


def integrates(context: Context) -> bool:
    return context.plant.leak == 0.0


def load_drift(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """A load that moves on an integrator: PV bends."""
    return signal + values[2] * behind_lag(ramp(context, values[0], values[0] + values[1]), context)


def since(_: FloatArray, values: FloatArray, context: Context) -> BoolArray:
    return context.time_s >= values[0]


def between(_: FloatArray, values: FloatArray, context: Context) -> BoolArray:
    return (context.time_s >= values[0]) & (context.time_s < values[1])


def lasts(values: FloatArray, context: Context) -> bool:
    """A pulse is a stretch, not a spike."""
    return bool(values[1] - values[0] >= 12.0 * context.record.sampling_interval_s)


def not_at_the_edge(values: FloatArray, context: Context) -> bool:
    margin = 8.0 * context.record.sampling_interval_s
    return bool(margin <= values[0] <= context.record.duration_s - margin)


AFTER = "after a time"
BLOCKS = (
    Block(
        "disturbance.step",
        "disturbance",
        "output",
        AFTER,
        step_parameters,
        step_starts,
        apply=load_step,
        active=since,
        penalty=14.0,
        rough=True,
        abrupt=True,
        sensible=not_at_the_edge,
    ),
    Block(
        "sensor.step",
        "sensor",
        "output",
        AFTER,
        step_parameters,
        step_starts,
        apply=sensor_step,
        active=since,
        penalty=14.0,
        rough=True,
        abrupt=True,
        sensible=not_at_the_edge,
    ),
    Block(
        "disturbance.step",
        "disturbance",
        "output",
        "within a time",
        pulse_parameters,
        pulse_starts,
        apply=load_pulse,
        active=between,
        form="pulse",
        penalty=17.0,
        rough=True,
        abrupt=True,
        sensible=lasts,
    ),
    Block(
        "sensor.step",
        "sensor",
        "output",
        "within a time",
        pulse_parameters,
        pulse_starts,
        apply=sensor_pulse,
        active=between,
        form="pulse",
        penalty=17.0,
        rough=True,
        abrupt=True,
        sensible=lasts,
    ),
    Block(
        "sensor.drift",
        "sensor",
        "output",
        AFTER,
        drift_parameters,
        drift_starts,
        apply=sensor_drift,
        active=since,
        penalty=16.0,
    ),
    Block(
        "disturbance.ramp",
        "disturbance",
        "output",
        AFTER,
        drift_parameters,
        drift_starts,
        apply=load_drift,
        active=since,
        penalty=16.0,
        suits=integrates,
    ),
)
