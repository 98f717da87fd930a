"""A gain that drifts with time: fouling, wear, a change of feed. A ramp that holds its end, or a step. Where it is that
of all that flows, what the working point is worth drifts with it.
"""

from dataclasses import replace

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, Part, Sum, grid, no_scan
from app.engine.mismatch.physics.moments import between, jumps_at, moment, ramp, since, stretches
from app.engine.recording import FloatArray

_EDGE = 0.03
_LEAST_PASSING = 0.05
_LEAST_OF_WHOLE, _FARTHEST = 0.05, 20.0  # share of gain; of OP's span


def _change(context: Context) -> Parameter:
    return Parameter("change", "share of gain", -0.9, 3.0, 1.0, linear=True)


def _reference(context: Context) -> float:
    """Where the loop stood at the start: what later moves is measured from there."""
    return float(np.mean(context.record.op_deviation[:3]))


def _scaled(signal: FloatArray, share: FloatArray, context: Context) -> FloatArray:
    return signal + share * (signal - _reference(context))


def _ramp_parameters(context: Context) -> tuple[Parameter, ...]:
    return (moment("start", context), _change(context))


def _ramp_starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.duration_s * np.linspace(0.0, 0.85, 18), np.zeros(1))


def _to_the_end(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return _scaled(signal, values[1] * ramp(context, values[0], context.record.reference_duration_s), context)


def _step_starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.duration_s * np.linspace(0.05, 0.92, 30), np.zeros(1))


def _stepped(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return _scaled(signal, values[1] * ramp(context, values[0], values[0]), context)


def _held_parameters(context: Context) -> tuple[Parameter, ...]:
    return (moment("start", context), moment("end", context), _change(context))


def _held_starts(context: Context, _: FloatArray) -> FloatArray:
    return stretches(context.record.duration_s * np.linspace(0.0, 1.0, 9))


def _held(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return _scaled(signal, values[2] * ramp(context, values[0], values[1]), context)


def _passing(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    begin, end, share = values
    return _scaled(signal, share * (ramp(context, begin, begin) - ramp(context, end, end)), context)


def _passing_starts(context: Context, _: FloatArray) -> FloatArray:
    return stretches(context.record.duration_s * np.linspace(0.04, 0.96, 24), 2)


def _comes_and_goes(values: FloatArray, context: Context) -> bool:
    """Another gain for a while, that begins and ends within the record; one that does not is a step."""
    duration = context.record.duration_s
    begin, end = values[:2].tolist()
    return bool(
        begin >= _EDGE * duration and end <= (1.0 - _EDGE) * duration and end - begin >= _LEAST_PASSING * duration
    )


def _seen_before_and_after(values: FloatArray, context: Context) -> bool:
    """A gain that is another one from the start on, or over no time at all, has not drifted. values: the start, and
    where a third is there the end of the change.
    """
    last = values[1] if len(values) > 2 else values[0]
    duration = context.record.duration_s
    return bool(last >= _EDGE * duration and values[0] <= (1.0 - _EDGE) * duration)


def _whole_parameters(context: Context) -> tuple[Parameter, ...]:
    """shift: by how much the working point's own worth changes: its distance from where nothing flows, which no record
    of OP shows, times the change.
    """
    span = context.record.op_span
    return (*_ramp_parameters(context), Parameter("shift", "OP", -20.0 * span, 20.0 * span, 0.1 * span, linear=True))


def _whole_starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.duration_s * np.linspace(0.0, 0.85, 14), np.zeros(1), np.zeros(1))


def _whole_step_starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.duration_s * np.linspace(0.05, 0.92, 24), np.zeros(1), np.zeros(1))


def _whole_to_the_end(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    share = ramp(context, values[0], context.record.reference_duration_s)
    return _scaled(signal, values[1] * share, context) + values[2] * share


def _whole_stepped(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    share = ramp(context, values[0], values[0])
    return _scaled(signal, values[1] * share, context) + values[2] * share


def flows_one_way(values: FloatArray, context: Context) -> bool:
    """Whether where nothing flows is beyond all that OP did: what is scaled does not turn its sign. And no further than
    any OP is: a load that steps is a hardly other gain of what flows from very far.
    """
    change, shift = values[1:].tolist()
    if abs(change) < _LEAST_OF_WHOLE or abs(shift) > _FARTHEST * context.record.op_span * abs(change):
        return False
    nothing, op = _reference(context) - shift / change, context.record.op_deviation
    return not float(np.min(op)) < nothing < float(np.max(op))


def _steps_one_way(values: FloatArray, context: Context) -> bool:
    return _seen_before_and_after(values[:1], context) and flows_one_way(values, context)


_CODE, _WHEN = "process.gain_drift", "after a time"
_RAMPED = Block(
    _CODE,
    "process",
    "input",
    _WHEN,
    _ramp_parameters,
    _ramp_starts,
    apply=_to_the_end,
    active=since,
    penalty=15.0,
    frees_gain=True,
    affine=True,
)
_STEPPED = replace(
    _RAMPED,
    starts=_step_starts,
    apply=_stepped,
    form="step",
    sensible=_seen_before_and_after,
    abrupt=True,
    penalty=16.0,
    rough=True,
)
_WHOLE = replace(
    _RAMPED,
    parameters=_whole_parameters,
    starts=_whole_starts,
    apply=_whole_to_the_end,
    form="whole",
    sensible=flows_one_way,
    strict=True,
    penalty=20.0,
)


def _passings(points: FloatArray, _: Context) -> Sum:
    return jumps_at(_STEPPED, points[:, :2], np.array([1.0, -1.0]))


BLOCKS = (
    _RAMPED,
    _STEPPED,
    replace(
        _RAMPED,
        parameters=_held_parameters,
        starts=_held_starts,
        apply=_held,
        form="held",
        sensible=_seen_before_and_after,
        penalty=17.0,
    ),
    replace(
        _STEPPED,
        condition="within a time",
        parameters=_held_parameters,
        starts=_passing_starts,
        apply=_passing,
        sum_of=_passings,
        active=between,
        form="passing",
        sensible=_comes_and_goes,
        penalty=20.0,
    ),
    _WHOLE,
    replace(
        _WHOLE,
        starts=_whole_step_starts,
        apply=_whole_stepped,
        form="whole-step",
        sensible=_steps_one_way,
        abrupt=True,
        penalty=21.0,
        rough=True,
    ),
)


def _lasted_parameters(context: Context) -> tuple[Parameter, ...]:
    """offset: what the change makes of where the loop stood when it was measured, and of the working point's worth."""
    span = context.record.op_span
    return (_change(context), Parameter("offset", "OP", -20.0 * span, 20.0 * span, 0.1 * span, linear=True))


def _lasted(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return signal + values[0] * signal + values[1]


LASTED = Block(_CODE, "process", "input", _WHEN, _lasted_parameters, no_scan, apply=_lasted, form="lasted", affine=True)
"""A gain that has drifted before the record begins: in none that it is looked for, because a linear refit has it."""
_ENDS = {"": (1, 2), "step": (1, 2), "held": (2, 3), "whole": (1, 3), "whole-step": (1, 3)}
"""Which of the values of a form are its change, and what moves the working point with it."""


def as_it_ended(part: Part, context: Context) -> Part:
    """A drift of the context's record as it is in a later one; any other part, and what came and went, as it is."""
    if part.block.code != _CODE or part.block.form not in _ENDS:
        return part
    first, end = _ENDS[part.block.form]
    size, *shift = part.values[first:end].tolist()
    offset = sum(shift) - size * _reference(context)
    return Part(LASTED, np.array([size, offset]))
