"""Valve stiction: the stem holds until OP has overcome static friction, then slips. Models and sources in
`app.engine.valve`.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.physics.moments import EDGE, amid, moment
from app.engine.mismatch.physics.stem import PENALTY, START, first_position
from app.engine.recording import BoolArray, FloatArray
from app.engine.valve import choudhury_stem, he_stem

CODE = "valve.stiction"

Sizes = TypeVar("Sizes", float, FloatArray)
Stem = Callable[[FloatArray, float, float, float], FloatArray]


def _parameters(context: Context) -> tuple[Parameter, ...]:
    """S within the range over which OP moved: behind a wider band no reversal of the record could have moved the stem.
    J is a share of S, and with it within that range.
    """
    span = context.record.op_span
    return (
        Parameter("S", "OP", 0.003 * span, context.record.op_range, span, log=True),
        Parameter("share", "J/S", 0.0, 1.0, 1.0),
        START,
    )


def _starts(context: Context, _: FloatArray) -> FloatArray:
    shares = np.array([0.1, 0.3, 0.5, 0.7, 0.9, 1.0])
    return grid(context.record.op_span * np.geomspace(0.02, 1.2, 26), shares, np.zeros(1))


def _stem(signal: FloatArray, values: FloatArray) -> tuple[float, float, float]:
    """S, J and the stem's first position, unit of OP."""
    S, share = values[:2].tolist()
    J = S * share
    return S, J, first_position(float(signal[0]), values, 2, reach(S, J))


def reach(S: Sizes, J: Sizes) -> Sizes:
    """How far a stem may stand from OP, unit of OP: where it lets go."""
    return 0.5 * (S + J)


def slipping_as(values: FloatArray, share: float) -> list[FloatArray]:
    """The numbers (3,) of stems with another slip, J / S = `share`, that slip first where the stem of `values` does,
    downwards or upwards.
    """
    starts = [float(start_slipping_as(values[2], values[1], np.array(share), side)) for side in (1.0, -1.0)]
    return [np.array([values[0], share, start]) for start in starts if abs(start) <= 1.0]


def start_slipping_as(start: float, share: float, others: FloatArray, side: float) -> FloatArray:
    """Where stems with other slips, J / S = `others`, stood at first if they let go where a stem of `start` and
    `share` does, downwards (side 1) or upwards (-1): the distance from there, (1 -+ start) (S + J) / 2, is the same.

    All later slips hang on S alone as long as OP does not go on in one direction by more than J, and what a record then
    tells is J times the gain: along these numbers the likelihood is flat, across them it jumps.
    """
    return side * (1.0 - (1.0 - side * start) * (1.0 + share) / (1.0 + others))


def _he(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return he_stem(np.ascontiguousarray(signal), *_stem(signal, values))


def _choudhury(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return choudhury_stem(np.ascontiguousarray(signal), *_stem(signal, values))


def _sets_in_parameters(context: Context) -> tuple[Parameter, ...]:
    """Those of the stem, and from when on it sticks: before, it is where OP is."""
    return (*_parameters(context)[:2], moment("start", context))


def _moments(context: Context) -> FloatArray:
    """Those, s, at which a scan lets a stem begin to stick."""
    return context.record.duration_s * np.linspace(EDGE, 1.0 - EDGE, 7)


def _sets_in_starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(context.record.op_span * np.geomspace(0.03, 1.0, 8), np.array([0.2, 0.5, 0.8]), _moments(context))


def _fewer_sizes(context: Context, _: FloatArray) -> FloatArray:
    """One slip and six bands: beside any stem that was found they are looked for closely (`kindred`)."""
    return grid(context.record.op_span * np.geomspace(0.05, 0.8, 6), np.array([0.5]), _moments(context))


def _sticking_since(stem_of: Stem, signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """The stem follows until it sticks, where it then is."""
    S, share, start_s = values.tolist()
    out, first = signal.copy(), int(np.searchsorted(context.time_s, start_s))
    if first < len(signal):
        out[first:] = stem_of(np.ascontiguousarray(signal[first:]), S, S * share, float(signal[max(first - 1, 0)]))
    return out


def sets_in(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return _sticking_since(he_stem, signal, values, context)


def _choudhury_sets_in(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return _sticking_since(choudhury_stem, signal, values, context)


def _sticks_since(_: FloatArray, values: FloatArray, context: Context) -> BoolArray:
    return context.time_s >= values[2]


def _seen_on_both_sides(values: FloatArray, context: Context) -> bool:
    """Whether OP turns so much before the moment and after it that such a stem would show in both."""
    op = np.ascontiguousarray(context.record.op_deviation)
    shows = (he_stem(op, float(values[0]), float(values[0] * values[1]), float(op[0])) - op) ** 2
    return amid(float(values[2]), shows, context)


SETS_IN = Block(
    CODE,
    "valve",
    "valve",
    "after OP reversals, from a time on",
    _sets_in_parameters,
    _sets_in_starts,
    apply=sets_in,
    active=_sticks_since,
    form="sets_in",
    penalty=22.0,
    rough=True,
    finalists=2,
    sensible=_seen_on_both_sides,
)
CHOUDHURY_SETS_IN = replace(SETS_IN, starts=_fewer_sizes, apply=_choudhury_sets_in, form="choudhury_sets_in")

HE, CHOUDHURY = (
    Block(
        CODE,
        "valve",
        "valve",
        "after OP reversals",
        _parameters,
        _starts,
        apply=model,
        form=form,
        penalty=18.0 + PENALTY,
        rough=True,
        finalists=4,
    )
    for form, model in (("he", _he), ("choudhury", _choudhury))
)

BLOCKS = (HE, CHOUDHURY, SETS_IN, CHOUDHURY_SETS_IN)
