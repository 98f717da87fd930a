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

_SHARPEST = 15
_LEAST_DRIFT = 0.04  # of the record
_SLOWER = 1.3
_RETURNS = 13  # moments at which a load may begin, turn and be back


def _as_drive(context: Context) -> float:
    """The OP that moves the process as a load of 1 unit of PV does; where the process integrates, one that moves it by
    that much in a tenth of the record that sizes are told of.
    """
    plant = context.plant
    strength = 1.0 if plant.leak > 0.0 else 10.0 * plant.tau / context.record.reference_duration_s
    return strength / plant.K


def _enters(context: Context, begin_s: float, end_s: float) -> FloatArray:
    """A load of 1 (N,) in the unit of OP, 0 before begin_s and full from end_s: earlier by the dead time that OP has
    before it reaches the process and a load has not.
    """
    late = context.plant.theta
    return _as_drive(context) * ramp(context, begin_s - late, end_s - late)


def _load_rise(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[1] * _as_drive(context) * rise(context, values[0] - context.plant.theta)


def _sensor_rise(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[1] * rise(context, values[0])


def _step_parameters(context: Context) -> tuple[Parameter, ...]:
    return (moment("start", context), size(context))


def _jumps(context: Context, innovations: FloatArray, most: int) -> FloatArray:
    """The moments (M,), s, of the largest innovations: a jump of the sensor is one sample wide."""
    sharp = np.sort(np.argsort(-np.abs(innovations[5:]))[:most]) + 4
    return np.asarray(sharp * context.record.sampling_interval_s, dtype=np.float64)


def _step_starts(context: Context, innovations: FloatArray) -> FloatArray:
    """Evenly spread moments, and those where PV jumps."""
    even = np.linspace(0.015, 0.985, 110) * context.record.samples * context.record.sampling_interval_s
    times = np.concatenate((_jumps(context, innovations, 20), even))
    return np.stack((times, np.zeros_like(times)), axis=1)


def _sensor_step(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[1] * ramp(context, values[0], values[0])


def _load_step(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[1] * _enters(context, values[0], values[0])


def _pulse_parameters(context: Context) -> tuple[Parameter, ...]:
    return (moment("start", context), moment("end", context), size(context))


def _pulse_starts(context: Context, _: FloatArray) -> FloatArray:
    return stretches(context.record.duration_s * np.linspace(0.02, 0.98, 25))


def _sensor_pulse_starts(context: Context, innovations: FloatArray) -> FloatArray:
    """Evenly spread stretches, and those between any two jumps of PV."""
    between_jumps = stretches(_jumps(context, innovations, _SHARPEST))
    return np.concatenate((_pulse_starts(context, innovations), between_jumps))


def _pulse(context: Context, values: FloatArray) -> FloatArray:
    return ramp(context, values[0], values[0]) - ramp(context, values[1], values[1])


def _sensor_pulse(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[2] * _pulse(context, values)


def _load_pulse(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    lasting = _enters(context, values[0], values[0]) - _enters(context, values[1], values[1])
    return signal + values[2] * lasting


def _drift_parameters(context: Context) -> tuple[Parameter, ...]:
    ts, duration = context.record.sampling_interval_s, context.record.duration_s
    return (
        moment("start", context),
        Parameter("lasting", "s", 10.0 * ts, 1.5 * duration, duration, log=True),
        size(context),
    )


def _drift_starts(context: Context, _: FloatArray) -> FloatArray:
    return np.array([(a, b - a, 0.0) for a, b, _ in _pulse_starts(context, _)])


def _sensor_drift(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[2] * ramp(context, values[0], values[0] + values[1])


def _load_drift(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """A load that moves: on an integrator PV bends, a full vessel runs over."""
    return signal + values[2] * _enters(context, values[0], values[0] + values[1])


def _returning_parameters(context: Context) -> tuple[Parameter, ...]:
    return (*_pulse_parameters(context)[:2], moment("turn", context), size(context))


def _returning_starts(context: Context, _: FloatArray) -> FloatArray:
    times = context.record.duration_s * np.linspace(0.02, 0.98, _RETURNS)
    return np.array([(a, c, b, 0.0) for a, b, c in combinations(times, 3)])


def _returning(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """A load that moves until it turns, and goes all the way back."""
    begin, end, turn, reached = values
    return signal + reached * (_enters(context, begin, turn) - _enters(context, turn, end))


def _goes_and_comes(values: FloatArray, context: Context) -> bool:
    """It turns between its ends, and not as quickly as a pulse would."""
    begin, end, turn = values[:3]
    steep = _LEAST_DRIFT * context.record.duration_s
    return lasts(values, context) and bool(turn - begin >= steep and end - turn >= steep)


def _recalibrated_starts(context: Context, innovations: FloatArray) -> FloatArray:
    """Ends where PV jumps most, and evenly spread ones; begins before each."""
    duration = context.record.duration_s
    sharp = _jumps(context, innovations, _SHARPEST)
    ends = np.unique(np.concatenate((sharp, duration * np.linspace(0.1, 0.98, 14))))
    return np.array(
        [(a, b, 0.0) for a in duration * np.linspace(0.05, 0.9, 13) for b in ends if b - a > _LEAST_DRIFT * duration]
    )


def _recalibrated(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """A sensor that drifts away from begin to end, where it is set right."""
    begin, end, reached = values
    return signal + reached * (ramp(context, begin, end) - ramp(context, end, end))


def _drifts_back(values: FloatArray, context: Context) -> bool:
    """A drift that is set right lasts longer than a spike, and begins and ends within the record: one that is there
    from the start on is what a step looks like on a slow load.
    """
    long_enough = values[1] - values[0] >= _LEAST_DRIFT * context.record.duration_s
    return bool(long_enough and inside(float(values[0]), context) and inside(float(values[1]), context))


def _levelling_parameters(context: Context) -> tuple[Parameter, ...]:
    ts, duration = context.record.sampling_interval_s, context.record.duration_s
    return (moment("start", context), Parameter("tau", "s", 5.0 * ts, duration, duration, log=True), size(context))


def _levelling_starts(context: Context, _: FloatArray) -> FloatArray:
    duration = context.record.duration_s
    return grid(duration * np.linspace(0.0, 0.92, 24), duration * np.array([0.03, 0.08, 0.2]), np.zeros(1))


def _levelling(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """What drifts fast at first and then slower and slower: 1 - exp(-t / tau)."""
    since_start = np.maximum(context.time_s - values[0], 0.0)
    return signal + values[2] * -np.expm1(-since_start / values[1])


def _slower_than_the_process(values: FloatArray, context: Context) -> bool:
    """What levels out as quickly as the process answers is a step of its load."""
    return bool(values[1] > _SLOWER * slowness(context) and inside(float(values[0]), context))


def lasts(values: FloatArray, context: Context) -> bool:
    """A pulse is a stretch, not a spike; one that reaches to either end of the record is a step at its other end."""
    long_enough = values[1] - values[0] >= 12.0 * context.record.sampling_interval_s
    return bool(long_enough and inside(float(values[0]), context) and inside(float(values[1]), context))


def _not_at_the_edge(values: FloatArray, context: Context) -> bool:
    return inside(float(values[0]), context)


_AFTER = "after a time"
LOAD_STEP = Block(
    "disturbance.step",
    "disturbance",
    "load",
    _AFTER,
    _step_parameters,
    _step_starts,
    apply=_load_step,
    active=since,
    penalty=14.0,
    rough=True,
    abrupt=True,
    sensible=_not_at_the_edge,
    affine=True,
)
SENSOR_STEP = replace(LOAD_STEP, code="sensor.step", place="sensor", stage="output", apply=_sensor_step)
# Of these the sums below are made; nobody is offered them.
_LOAD_RISE, _SENSOR_RISE = replace(LOAD_STEP, apply=_load_rise), replace(SENSOR_STEP, apply=_sensor_rise)


def _pulses_of(block: Block) -> Callable[[FloatArray, Context], Sum]:
    return lambda points, _: jumps_at(block, points[:, :2], np.array([1.0, -1.0]))


def _drifts_of(block: Block) -> Callable[[FloatArray, Context], Sum]:
    return lambda points, context: slopes_at(block, points[:, 0], points[:, 0] + points[:, 1], context)


def _returns(points: FloatArray, context: Context) -> Sum:
    begin, end, turn = points[:, 0], points[:, 1], points[:, 2]
    return added(slopes_at(_LOAD_RISE, begin, turn, context), slopes_at(_LOAD_RISE, turn, end, context), -1.0)


def _recalibrations(points: FloatArray, context: Context) -> Sum:
    away = slopes_at(_SENSOR_RISE, points[:, 0], points[:, 1], context)
    return added(away, jumps_at(SENSOR_STEP, points[:, 1:2], np.ones(1)), -1.0)


SENSOR_DRIFT = Block(
    "sensor.drift",
    "sensor",
    "output",
    _AFTER,
    _drift_parameters,
    _drift_starts,
    apply=_sensor_drift,
    sum_of=_drifts_of(_SENSOR_RISE),
    affine=True,
    active=since,
    penalty=16.0,
)
LOAD_DRIFT = replace(
    SENSOR_DRIFT,
    code="disturbance.ramp",
    place="disturbance",
    stage="load",
    apply=_load_drift,
    sum_of=_drifts_of(_LOAD_RISE),
)
LEVELLING = Block(
    "sensor.drift",
    "sensor",
    "output",
    _AFTER,
    _levelling_parameters,
    _levelling_starts,
    apply=_levelling,
    affine=True,
    active=since,
    form="levelling",
    penalty=17.0,
    sensible=_slower_than_the_process,
)
BLOCKS = (
    LOAD_STEP,
    SENSOR_STEP,
    Block(
        "disturbance.step",
        "disturbance",
        "load",
        "within a time",
        _pulse_parameters,
        _pulse_starts,
        apply=_load_pulse,
        sum_of=_pulses_of(LOAD_STEP),
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
        _pulse_parameters,
        _sensor_pulse_starts,
        apply=_sensor_pulse,
        sum_of=_pulses_of(SENSOR_STEP),
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
        _returning_parameters,
        _returning_starts,
        apply=_returning,
        sum_of=_returns,
        affine=True,
        active=between,
        form="returning",
        penalty=18.5,
        sensible=_goes_and_comes,
    ),
    Block(
        "sensor.drift",
        "sensor",
        "output",
        "within a time",
        _pulse_parameters,
        _recalibrated_starts,
        apply=_recalibrated,
        sum_of=_recalibrations,
        affine=True,
        active=between,
        form="recalibrated",
        penalty=17.0,
        rough=True,
        abrupt=True,
        sensible=_drifts_back,
    ),
    LEVELLING,
)
