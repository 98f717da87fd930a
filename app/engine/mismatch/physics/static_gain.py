"""A gain that depends on the operating point: of the valve (its installed characteristic) or of the process.

With OP and PV alone a curved valve and a curved process are told apart only by the lag between them. Characteristic:
Liptak, Control Valve Selection, equal percentage R^(x - 1). Process: gain linear in the operating point, before the lag
(Hammerstein) or after it (Wiener).
"""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.recording import FloatArray

# About the mean square of a signal over its span: a constant keeps gain and offset of the linear model nearly as
# they are.
MEAN_SQUARE = 0.08
# Where OP leaves its span far behind, no valve goes on exponentially; finite for any OP.
MOST_EXPONENT = 100.0
LIMIT = -0.9


def bend(context: Context) -> tuple[Parameter, ...]:
    return (Parameter("bend", "1/OP span", -6.0, 6.0, 1.0),)


def bends(_: Context, __: FloatArray) -> FloatArray:
    return np.array([-3.0, -1.5, -0.7, -0.3, 0.3, 0.7, 1.5, 3.0])[:, None]


def exponential(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """(exp(c u) - 1) / c: an equal-percentage valve, c = ln R over the span; c below zero: quick opening."""
    c = values[0] / context.record.op_span
    return np.expm1(np.minimum(c * signal, MOST_EXPONENT)) / c if abs(values[0]) > 1e-6 else signal


def curvature(context: Context) -> tuple[Parameter, ...]:
    return (Parameter("curvature", "1/OP span", -3.0, 3.0, 1.0, linear=True),)


def none_at_first(_: Context, __: FloatArray) -> FloatArray:
    return np.zeros((1, 1))


def quadratic(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal + values[0] / context.record.op_span * (signal * signal - MEAN_SQUARE * context.record.op_span**2)


def cubic_parameters(context: Context) -> tuple[Parameter, ...]:
    return (*curvature(context), Parameter("third", "1/OP span^2", -6.0, 6.0, 1.0, linear=True))


def zeros_of_two(_: Context, __: FloatArray) -> FloatArray:
    return np.zeros((1, 2))


def cubic(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    x = signal / context.record.op_span
    square = x * x
    return context.record.op_span * (x + values[0] * (square - MEAN_SQUARE) + values[1] * square * x)


def wiener_parameters(_: Context) -> tuple[Parameter, ...]:
    return (Parameter("curvature", "1/PV span", -1.5, 1.5, 1.0, linear=True),)


def wiener(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    x = signal / context.record.pv_span
    return context.record.pv_span * (x + values[0] * (x * x - MEAN_SQUARE))


def wiener_cubic_parameters(context: Context) -> tuple[Parameter, ...]:
    return (*wiener_parameters(context), Parameter("third", "1/PV span^2", -3.0, 3.0, 1.0, linear=True))


def wiener_cubic(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    x = signal / context.record.pv_span
    square = x * x
    return context.record.pv_span * (x + values[0] * (square - MEAN_SQUARE) + values[1] * square * x)


def rises(values: FloatArray, context: Context) -> bool:
    """Whether PV shows more wherever there is more, over all that PV did: what turns back is no scale."""
    x = context.record.pv_deviation / context.record.pv_span
    ends = np.linspace(float(np.min(x)), float(np.max(x)), 9)
    return bool(np.all(1.0 + 2.0 * values[0] * ends + 3.0 * values[1] * ends * ends > 0.0))


def kink_parameters(context: Context) -> tuple[Parameter, ...]:
    low, high = np.quantile(context.record.op_deviation, (0.08, 0.92))
    span = context.record.op_span
    return (
        Parameter("corner", "OP level", float(low), float(high), span),
        Parameter("change", "share of gain", -0.95, 3.0, 1.0, linear=True),
    )


def kinks(context: Context, _: FloatArray) -> FloatArray:
    return grid(np.quantile(context.record.op_deviation, np.linspace(0.15, 0.85, 8)), np.zeros(1))


def still_answers(values: FloatArray, _: Context) -> bool:
    """Beyond a corner that leaves nearly no gain stands a limit, which has a name of its own."""
    return bool(values[1] > LIMIT)


def kink(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return signal + values[1] * np.maximum(signal - values[0], 0.0)


WHERE = "at another operating point"
BLOCKS = (
    Block(
        "valve.characteristic", "valve", "input", WHERE, bend, bends, apply=exponential, penalty=12.0, frees_gain=True
    ),
    Block(
        "process.nonlinear_gain",
        "process",
        "input",
        WHERE,
        curvature,
        none_at_first,
        apply=quadratic,
        penalty=12.0,
        frees_gain=True,
    ),
    Block(
        "process.nonlinear_gain",
        "process",
        "output",
        WHERE,
        wiener_parameters,
        none_at_first,
        apply=wiener,
        form="wiener",
        penalty=12.5,
        frees_gain=True,
    ),
    Block(
        "process.nonlinear_gain",
        "process",
        "output",
        WHERE,
        wiener_cubic_parameters,
        zeros_of_two,
        apply=wiener_cubic,
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
        WHERE,
        cubic_parameters,
        zeros_of_two,
        apply=cubic,
        form="cubic",
        penalty=15.0,
        frees_gain=True,
    ),
    Block(
        "process.nonlinear_gain",
        "process",
        "input",
        WHERE,
        kink_parameters,
        kinks,
        apply=kink,
        form="kink",
        sensible=still_answers,
        penalty=15.5,
        frees_gain=True,
    ),
)
