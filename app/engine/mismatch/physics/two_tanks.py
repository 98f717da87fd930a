"""Two tanks in a row under a pump: outflow by the root of the level, and an upper tank that runs over, partly into the
lower one.

tau x1' = K u + b - f1(x1), x1 <= high; tau2 x2' = f1(x1) + spill over - f2(x2); f(x) = (1 - w) 2 h (sqrt(1 + x/h) - 1)
+ w x, with h the level's distance above empty at the working point, w the share of the outflow that is linear (losses
in the pipe). Grey box of Rogers, Holub, Schoukens et al. 2017 for the benchmark of Schoukens, Noel 2017, doi
10.1016/j.ifacol.2017.08.071.
"""

import numpy as np
from numba import njit

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.loop.plant import Plant, delay
from app.engine.mismatch.physics.scales import depth
from app.engine.mismatch.physics.vessel import OVERFLOW
from app.engine.recording import FloatArray

_STEPS = 4


@njit(cache=True, nogil=True)
def _flow(x: float, head: float, linear: float) -> float:
    return (1.0 - linear) * 2.0 * head * (np.sqrt(max(1.0 + x / head, 0.0)) - 1.0) + linear * x


@njit(cache=True, nogil=True)
def _tanks(u: FloatArray, p: FloatArray, values: FloatArray, ts: float) -> FloatArray:
    K, tau, b, tau2, start = p[0], p[1], p[2], p[3], p[4]
    head1, head2, linear1, linear2, first, high, spill, full = values
    h = ts / _STEPS
    x1, x2 = min(first, high), start
    y = np.empty(len(u))
    y[0] = x2
    for t in range(1, len(u)):
        drive = K * u[t - 1] + b
        for _ in range(_STEPS):
            out = _flow(x1, head1, linear1)
            over = 0.0
            x1 += h / tau * (drive - out)
            if x1 > high:
                over = (x1 - high) * tau / h
                x1 = high
            x1 = max(x1, -head1)
            x2 = x2 + h / tau2 * (out + spill * over - _flow(x2, head2, linear2))
            x2 = min(max(x2, -head2), full)
        y[t] = x2
    return y


def run(v: FloatArray, plant: Plant, values: FloatArray, context: Context) -> FloatArray:
    """PV (N,) as deviation: the level of the lower tank, by the equations above in _STEPS explicit steps a sample.

    v: (N,) valve position, unit of OP, as deviation. values: (8,) as `_parameters` names them: head of both tanks,
    share of their outflow that is linear, start and limit of the upper one, share of its overflow that the lower one
    gets, limit of the lower one. Misleads where tau or tau2 is near a sampling interval: explicit steps are too coarse
    there.
    """
    ts = context.record.sampling_interval_s
    numbers = np.array([plant.K, plant.tau, plant.b, max(plant.tau2, 1e-6), plant.x0])
    return _tanks(delay(v, plant.theta, ts), numbers, values, ts)


def two_lags(context: Context) -> bool:
    """Only a process with two lags, or a lag and slow leaks, can be two tanks."""
    return context.plant.tau2 > 0.0 and context.plant.leak > 0.0


def _parameters(context: Context) -> tuple[Parameter, ...]:
    span = context.record.pv_span
    lowest = depth(context)
    return (
        Parameter("upper_head", "PV", 0.3 * lowest, 20.0 * span, span, log=True),
        Parameter("lower_head", "PV", 0.3 * lowest, 20.0 * span, span, log=True),
        Parameter("upper_linear_share", "share", 0.0, 1.0, 1.0),
        Parameter("lower_linear_share", "share", 0.0, 1.0, 1.0),
        Parameter("upper_start", "PV", -1.5 * span, 1.5 * span, span, begins=True),
        Parameter("upper_limit", "PV", -0.3 * span, 2.0 * span, span),
        Parameter("spill", "share", 0.0, 1.0, 1.0),
        Parameter("lower_limit", "PV level", 0.3 * span, 3.0 * span, span),
    )


def _starts(context: Context, _: FloatArray) -> FloatArray:
    span = context.record.pv_span
    lowest = depth(context)
    heads, highest = lowest * np.array([1.1, 2.0]), float(np.max(context.record.pv_deviation))
    fixed = (np.array([0.2]), np.array([0.2]), np.zeros(1))
    return grid(heads, heads, *fixed, span * np.array([0.3, 0.6]), np.array([0.5]), np.array([highest]))


BLOCKS = (
    Block(
        "process.outflow_law",
        "process",
        "process",
        "at another level",
        _parameters,
        _starts,
        replaces=run,
        form="two-tanks",
        penalty=30.0,
        frees_gain=True,
        suits=two_lags,
        brings=(OVERFLOW,),
        steps=25,
    ),
)
