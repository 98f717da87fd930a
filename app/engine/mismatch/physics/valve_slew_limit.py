"""Slew limit: the stem follows OP no faster than its actuator can travel, the same to either side or not: a spring
takes a stem back at another speed than air moves it.
"""

from dataclasses import replace

import numpy as np
from numba import njit

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.physics.stem import PENALTY, start_of_travel
from app.engine.recording import FloatArray

_STILL = 1e-12  # of OP's span: what an OP that stands moves in an interval
_LEAST_UNEVEN, _MOST_UNEVEN = 1.01, 10.0  # times as fast to one side as to the other; a quick exhaust opens at once
_UNEVEN_STARTS = (0.8, 1.25)  # how many times as fast down as up
_UNEVEN_PENALTY = 8.0  # nat; two fifths of it are more than 15 stems that are even gained by it (2.9 at most)


@njit(cache=True, nogil=True)
def _limited(u: FloatArray, up: float, down: float, start: float) -> FloatArray:
    v = np.empty(len(u))
    v[0] = start
    for t in range(1, len(u)):
        v[t] = v[t - 1] + min(max(u[t] - v[t - 1], -down), up)
    return v


def _travelled(signal: FloatArray, up: float, down: float, off: FloatArray, context: Context) -> FloatArray:
    """OP (N,), followed at `up` OP/s upwards and `down` times as fast downwards, from `off` beside it (1,) or (0,)."""
    step = up * context.record.sampling_interval_s
    start = float(signal[0]) + (float(off[0]) if len(off) else 0.0)
    return _limited(np.ascontiguousarray(signal), step, step * down, start)


def rates(context: Context) -> FloatArray:
    """The speeds at which OP moves, from slow to fast, OP/s; never zero."""
    moves = np.abs(np.diff(context.record.op))
    fast = max(float(np.max(moves)), _STILL * context.record.op_span) / context.record.sampling_interval_s
    slow = max(0.2 * context.record.op_span / context.record.duration_s, 1e-6 * fast)
    return np.array([min(slow, 0.5 * fast), fast])


def _parameters(context: Context) -> tuple[Parameter, ...]:
    slow, fast = rates(context)
    return (Parameter("rate", "OP/s", slow, fast, fast, log=True), start_of_travel(context))


def _starts(context: Context, _: FloatArray) -> FloatArray:
    slow, fast = rates(context)
    return grid(np.geomspace(slow, 0.9 * fast, 50), np.zeros(1))


def _follow(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return _travelled(signal, float(values[0]), 1.0, values[1:], context)


_EVEN = Block(
    "valve.slew_limit",
    "valve",
    "valve",
    "while OP moves fast",
    _parameters,
    _starts,
    apply=_follow,
    penalty=15.0 + PENALTY,
    rough=True,
)


def _uneven_parameters(context: Context) -> tuple[Parameter, ...]:
    rate, start = _parameters(context)
    down = Parameter("down", "of rate_up", 1.0 / _MOST_UNEVEN, _MOST_UNEVEN, 1.0, log=True)
    return (replace(rate, name="rate_up"), down, start)


def _uneven_starts(context: Context, _: FloatArray) -> FloatArray:
    slow, fast = rates(context)
    return grid(np.geomspace(slow, 0.9 * fast, 30), np.array(_UNEVEN_STARTS), np.zeros(1))


def _follow_unevenly(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return _travelled(signal, float(values[0]), float(values[1]), values[2:], context)


def _is_uneven(values: FloatArray, _: Context) -> bool:
    """An even stem that is followed closely may run nearer to PV with speeds a hundred-thousandth apart."""
    return bool(abs(np.log(values[1])) > np.log(_LEAST_UNEVEN))


UNEVEN = replace(
    _EVEN,
    form="uneven",
    parameters=_uneven_parameters,
    starts=_uneven_starts,
    apply=_follow_unevenly,
    penalty=_EVEN.penalty + _UNEVEN_PENALTY,
    sensible=_is_uneven,
)
BLOCKS = (_EVEN, UNEVEN)
