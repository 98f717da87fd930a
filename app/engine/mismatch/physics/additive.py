"""What is added to the loop: steps and ramps, of the load (through the process and whatever else PV passes) or of the
sensor (at once).
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, Sum, grid
from app.engine.mismatch.physics.moments import (
    added,
    between,
    inside,
    jumps_at,
    moment,
    ramp,
    rise,
    since,
    slopes_at,
    stretches,
)
from app.engine.mismatch.physics.scales import size, slowness
from app.engine.recording import FloatArray

SHARPEST = 15
LEAST_DRIFT = 0.04  # of the record
SLOWER = 1.3
RETURNS = 13  # moments at which a load may begin, turn and be back


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


def load_rise(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[1] * as_drive(context) * rise(context, values[0] - context.plant.theta)


def sensor_rise(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[1] * rise(context, values[0])


def step_parameters(context: Context) -> tuple[Parameter, ...]:
    return (moment("start", context), size(context))


def jumps(context: Context, innovations: FloatArray, most: int) -> FloatArray:
    """The moments (M,), s, of the largest innovations: a jump of the sensor is one sample wide."""
    sharp = np.sort(np.argsort(-np.abs(innovations[5:]))[:most]) + 4
    return np.asarray(sharp * context.record.sampling_interval_s, dtype=np.float64)


def step_starts(context: Context, innovations: FloatArray) -> FloatArray:
    """Evenly spread moments, and those where PV jumps."""
    even = np.linspace(0.015, 0.985, 110) * context.record.samples * context.record.sampling_interval_s
    times = np.concatenate((jumps(context, innovations, 20), even))
    return np.stack((times, np.zeros_like(times)), axis=1)


def sensor_step(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[1] * ramp(context, values[0], values[0])


def load_step(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[1] * enters(context, values[0], values[0])


def pulse_parameters(context: Context) -> tuple[Parameter, ...]:
    return (moment("start", context), moment("end", context), size(context))


def pulse_starts(context: Context, _: FloatArray) -> FloatArray:
    return stretches(context.record.duration_s * np.linspace(0.02, 0.98, 25))


def sensor_pulse_starts(context: Context, innovations: FloatArray) -> FloatArray:
    """Evenly spread stretches, and those between any two jumps of PV."""
    between_jumps = stretches(jumps(context, innovations, SHARPEST))
    return np.concatenate((pulse_starts(context, innovations), between_jumps))


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


def returning_parameters(context: Context) -> tuple[Parameter, ...]:
    return (*pulse_parameters(context)[:2], moment("turn", context), size(context))


def returning_starts(context: Context, _: FloatArray) -> FloatArray:
    times = context.record.duration_s * np.linspace(0.02, 0.98, RETURNS)
    return np.array([(a, c, b, 0.0) for a, b, c in combinations(times, 3)])


def returning(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """A load that moves until it turns, and goes all the way back."""
    begin, end, turn, reached = values
    return signal + reached * (enters(context, begin, turn) - enters(context, turn, end))


def goes_and_comes(values: FloatArray, context: Context) -> bool:
    """It turns between its ends, and not as quickly as a pulse would."""
    begin, end, turn = values[:3]
    steep = LEAST_DRIFT * context.record.duration_s
    return lasts(values, context) and bool(turn - begin >= steep and end - turn >= steep)


def recalibrated_starts(context: Context, innovations: FloatArray) -> FloatArray:
    """Ends where PV jumps most, and evenly spread ones; begins before each."""
    duration = context.record.duration_s
    sharp = jumps(context, innovations, SHARPEST)
    ends = np.unique(np.concatenate((sharp, duration * np.linspace(0.1, 0.98, 14))))
    return np.array(
        [(a, b, 0.0) for a in duration * np.linspace(0.05, 0.9, 13) for b in ends if b - a > LEAST_DRIFT * duration]
    )


def recalibrated(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """A sensor that drifts away from begin to end, where it is set right."""
    begin, end, reached = values
    return signal + reached * (ramp(context, begin, end) - ramp(context, end, end))


def drifts_back(values: FloatArray, context: Context) -> bool:
    """A drift that is set right lasts longer than a spike, and begins and ends within the record: one that is there
    from the start on is what a step looks like on a slow load.
    """
    long_enough = values[1] - values[0] >= LEAST_DRIFT * context.record.duration_s
    return bool(long_enough and inside(float(values[0]), context) and inside(float(values[1]), context))


def levelling_parameters(context: Context) -> tuple[Parameter, ...]:
    ts, duration = context.record.sampling_interval_s, context.record.duration_s
    return (moment("start", context), Parameter("tau", "s", 5.0 * ts, duration, duration, log=True), size(context))


def levelling_starts(context: Context, _: FloatArray) -> FloatArray:
    duration = context.record.duration_s
    return grid(duration * np.linspace(0.0, 0.92, 24), duration * np.array([0.03, 0.08, 0.2]), np.zeros(1))


def levelling(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """What drifts fast at first and then slower and slower: 1 - exp(-t / tau)."""
    since_start = np.maximum(context.time_s - values[0], 0.0)
    return signal + values[2] * -np.expm1(-since_start / values[1])


def slower_than_the_process(values: FloatArray, context: Context) -> bool:
    """What levels out as quickly as the process answers is a step of its load."""
    return bool(values[1] > SLOWER * slowness(context) and inside(float(values[0]), context))


def lasts(values: FloatArray, context: Context) -> bool:
    """A pulse is a stretch, not a spike; one that reaches to either end of the record is a step at its other end."""
    long_enough = values[1] - values[0] >= 12.0 * context.record.sampling_interval_s
    return bool(long_enough and inside(float(values[0]), context) and inside(float(values[1]), context))


def not_at_the_edge(values: FloatArray, context: Context) -> bool:
    return inside(float(values[0]), context)


AFTER = "after a time"
LOAD_STEP = Block(
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
    affine=True,
)
SENSOR_STEP = replace(LOAD_STEP, code="sensor.step", place="sensor", stage="output", apply=sensor_step)
# Of these the sums below are made; nobody is offered them.
LOAD_RISE, SENSOR_RISE = replace(LOAD_STEP, apply=load_rise), replace(SENSOR_STEP, apply=sensor_rise)


def pulses_of(block: Block) -> Callable[[FloatArray, Context], Sum]:
    return lambda points, _: jumps_at(block, points[:, :2], np.array([1.0, -1.0]))


def drifts_of(block: Block) -> Callable[[FloatArray, Context], Sum]:
    return lambda points, context: slopes_at(block, points[:, 0], points[:, 0] + points[:, 1], context)


def returns(points: FloatArray, context: Context) -> Sum:
    begin, end, turn = points[:, 0], points[:, 1], points[:, 2]
    return added(slopes_at(LOAD_RISE, begin, turn, context), slopes_at(LOAD_RISE, turn, end, context), -1.0)


def recalibrations(points: FloatArray, context: Context) -> Sum:
    away = slopes_at(SENSOR_RISE, points[:, 0], points[:, 1], context)
    return added(away, jumps_at(SENSOR_STEP, points[:, 1:2], np.ones(1)), -1.0)


SENSOR_DRIFT = Block(
    "sensor.drift",
    "sensor",
    "output",
    AFTER,
    drift_parameters,
    drift_starts,
    apply=sensor_drift,
    sum_of=drifts_of(SENSOR_RISE),
    affine=True,
    active=since,
    penalty=16.0,
)
LOAD_DRIFT = replace(
    SENSOR_DRIFT,
    code="disturbance.ramp",
    place="disturbance",
    stage="load",
    apply=load_drift,
    sum_of=drifts_of(LOAD_RISE),
)
LEVELLING = Block(
    "sensor.drift",
    "sensor",
    "output",
    AFTER,
    levelling_parameters,
    levelling_starts,
    apply=levelling,
    affine=True,
    active=since,
    form="levelling",
    penalty=17.0,
    sensible=slower_than_the_process,
)
BLOCKS = (
    LOAD_STEP,
    SENSOR_STEP,
    Block(
        "disturbance.step",
        "disturbance",
        "load",
        "within a time",
        pulse_parameters,
        pulse_starts,
        apply=load_pulse,
        sum_of=pulses_of(LOAD_STEP),
        affine=True,
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
        sensor_pulse_starts,
        apply=sensor_pulse,
        sum_of=pulses_of(SENSOR_STEP),
        affine=True,
        active=between,
        form="pulse",
        penalty=18.5,
        rough=True,
        abrupt=True,
        sensible=lasts,
    ),
    SENSOR_DRIFT,
    LOAD_DRIFT,
    Block(
        "disturbance.ramp",
        "disturbance",
        "load",
        "within a time",
        returning_parameters,
        returning_starts,
        apply=returning,
        sum_of=returns,
        affine=True,
        active=between,
        form="returning",
        penalty=18.5,
        sensible=goes_and_comes,
    ),
    Block(
        "sensor.drift",
        "sensor",
        "output",
        "within a time",
        pulse_parameters,
        recalibrated_starts,
        apply=recalibrated,
        sum_of=recalibrations,
        affine=True,
        active=between,
        form="recalibrated",
        penalty=17.0,
        rough=True,
        abrupt=True,
        sensible=drifts_back,
    ),
    LEVELLING,
)
