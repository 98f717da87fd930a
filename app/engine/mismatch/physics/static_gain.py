"""A gain that depends on the operating point: of the valve (its installed characteristic) or of the process.

With OP and PV alone a curved valve and a curved process are told apart only by the lag between them. Characteristic:
Liptak, Control Valve Selection, equal percentage R^(x - 1). Process: gain linear in the operating point, before the lag
(Hammerstein) or after it (Wiener).
"""

from collections.abc import Callable

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.recording import FloatArray

# About the mean square of a signal over its span: a constant keeps gain and offset of the linear model nearly as
# they are.
_MEAN_SQUARE = 0.08
# Where OP leaves its span far behind, no valve goes on exponentially; finite for any OP.
_MOST_EXPONENT = 100.0
_LIMIT = -0.9


def _bend(context: Context) -> tuple[Parameter, ...]:
    return (Parameter("bend", "1/OP span", -6.0, 6.0, 1.0),)


def _bends(_: Context, __: FloatArray) -> FloatArray:
    return np.array([-3.0, -1.5, -0.7, -0.3, 0.3, 0.7, 1.5, 3.0])[:, None]


def exponential(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """(exp(c u) - 1) / c: an equal-percentage valve, c = ln R over the span; c below zero: quick opening."""
    c = values[0] / context.record.op_span
    return np.expm1(np.minimum(c * signal, _MOST_EXPONENT)) / c if abs(values[0]) > 1e-6 else signal


def _powers(of: str, most: float, count: int) -> Callable[[Context], tuple[Parameter, ...]]:
    """How much of the square, and of the third power, stands beside a signal over its span: so many of the two."""
    each = (("curvature", f"1/{of} span", most), ("third", f"1/{of} span^2", 2.0 * most))
    parameters = tuple(Parameter(name, unit, -high, high, 1.0, linear=True) for name, unit, high in each[:count])
    return lambda _: parameters


def _none_at_first(count: int) -> Callable[[Context, FloatArray], FloatArray]:
    return lambda _, __: np.zeros((1, count))


def _quadratic(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[0] / context.record.op_span * (signal * signal - _MEAN_SQUARE * context.record.op_span**2)


def _wiener(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    x = signal / context.record.pv_span
    return context.record.pv_span * (x + values[0] * (x * x - _MEAN_SQUARE))


def cubic(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return _cubic(signal, values, context.record.op_span)


def _wiener_cubic(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return _cubic(signal, values, context.record.pv_span)


def _cubic(signal: FloatArray, values: FloatArray, span: float) -> FloatArray:
    x = signal / span
    square = x * x
    return span * (x + values[0] * (square - _MEAN_SQUARE) + values[1] * square * x)


def rises(values: FloatArray, context: Context) -> bool:
    """Whether PV shows more wherever there is more, over all that PV did: what turns back is no scale."""
    x = context.record.pv_deviation / context.record.pv_span
    ends = np.linspace(float(np.min(x)), float(np.max(x)), 9)
    return bool(np.all(1.0 + 2.0 * values[0] * ends + 3.0 * values[1] * ends * ends > 0.0))


def _kink_parameters(context: Context) -> tuple[Parameter, ...]:
    low, high = np.quantile(context.record.op_deviation, (0.08, 0.92))
    span = context.record.op_span
    return (
        Parameter("corner", "OP level", float(low), float(high), span),
        Parameter("change", "share of gain", -0.95, 3.0, 1.0, linear=True),
    )


def _kinks(context: Context, _: FloatArray) -> FloatArray:
    return grid(np.quantile(context.record.op_deviation, np.linspace(0.15, 0.85, 8)), np.zeros(1))


def _still_answers(values: FloatArray, _: Context) -> bool:
    """Beyond a corner that leaves nearly no gain stands a limit, which has a name of its own."""
    return bool(values[1] > _LIMIT)


def _kink(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return signal + values[1] * np.maximum(signal - values[0], 0.0)


_WHERE = "at another operating point"
BLOCKS = (
    Block(
        "valve.characteristic",
        "valve",
        "input",
        _WHERE,
        _bend,
        _bends,
        apply=exponential,
        penalty=12.0,
        frees_gain=True,
    ),
    Block(
        "process.nonlinear_gain",
        "process",
        "input",
        _WHERE,
        _powers("OP", 3.0, 1),
        _none_at_first(1),
        apply=_quadratic,
        penalty=12.0,
        frees_gain=True,
    ),
    Block(
        "process.nonlinear_gain",
        "process",
        "output",
        _WHERE,
        _powers("PV", 1.5, 1),
        _none_at_first(1),
        apply=_wiener,
        form="wiener",
        penalty=12.5,
        frees_gain=True,
    ),
    Block(
        "process.nonlinear_gain",
        "process",
        "output",
        _WHERE,
        _powers("PV", 1.5, 2),
        _none_at_first(2),
        apply=_wiener_cubic,
        form="wiener-cubic",
        sensible=rises,
        strict=True,
        penalty=15.5,
        frees_gain=True,
    ),
    Block(
        "process.nonlinear_gain",
        "process",
        "input",
        _WHERE,
        _powers("OP", 3.0, 2),
        _none_at_first(2),
        apply=cubic,
        form="cubic",
        penalty=15.0,
        frees_gain=True,
    ),
    Block(
        "process.nonlinear_gain",
        "process",
        "input",
        _WHERE,
        _kink_parameters,
        _kinks,
        apply=_kink,
        form="kink",
        sensible=_still_answers,
        penalty=15.5,
        frees_gain=True,
    ),
)
