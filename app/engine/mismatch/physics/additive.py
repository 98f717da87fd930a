"""What is added to the loop: steps and ramps, of the load (through the process and whatever else PV passes) or of the
sensor (at once).
"""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter
from app.engine.mismatch.physics.moments import between, inside, moment, ramp, since
from app.engine.mismatch.physics.scales import size
from app.engine.recording import FloatArray


def as_drive(context: Context) -> float:
    """The OP that moves the process as a load of 1 unit of PV does; where the process integrates, one that moves it by
    that much in a tenth of the record that sizes are told of.
    """
    plant = context.plant
    strength = 1.0 if plant.leak > 0.0 else 10.0 * plant.tau / context.record.reference_duration_s
    return strength / plant.K


def enters(context: Context, begin_s: float, end_s: float) -> FloatArray:
    """A load of 1 (N,) in the unit of OP, 0 before begin_s and full from end_s: earlier by the dead time that OP has
    before it reaches the process and a load has not.
    """
    late = context.plant.theta
    return as_drive(context) * ramp(context, begin_s - late, end_s - late)


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
    return signal + values[1] * enters(context, values[0], values[0])


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
    lasting = enters(context, values[0], values[0]) - enters(context, values[1], values[1])
    return signal + values[2] * lasting


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


def load_drift(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """A load that moves: on an integrator PV bends, a full vessel runs over."""
    return signal + values[2] * enters(context, values[0], values[0] + values[1])


def lasts(values: FloatArray, context: Context) -> bool:
    """A pulse is a stretch, not a spike; one that reaches to either end of the record is a step at its other end."""
    long_enough = values[1] - values[0] >= 12.0 * context.record.sampling_interval_s
    return bool(long_enough and inside(float(values[0]), context) and inside(float(values[1]), context))


def not_at_the_edge(values: FloatArray, context: Context) -> bool:
    return inside(float(values[0]), context)


AFTER = "after a time"
BLOCKS = (
    Block(
        "disturbance.step",
        "disturbance",
        "load",
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
        "load",
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
        "load",
        AFTER,
        drift_parameters,
        drift_starts,
        apply=load_drift,
        active=since,
        penalty=16.0,
    ),
)
