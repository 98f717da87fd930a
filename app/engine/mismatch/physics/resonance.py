"""A process that swings by itself: complex poles in place of its lags, as of a mass on a spring or a loop inside.

natural^2 x'' + 2 damping natural x' + x = K v + b, one over the natural frequency and the damping ratio fitted; below
a damping of 1 / sqrt(2) the process has a resonance.
Source: Seborg, Edgar, Mellichamp, Process Dynamics and Control, ISBN 978-1-119-28591-5, chapter 5.
"""

from dataclasses import replace

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics.process_dynamics import ALWAYS, settles
from app.engine.mismatch.physics.scales import slowness
from app.engine.recording import FloatArray

_LEAST_DAMPING, _RESONANT = 0.02, 0.7071


def _poles(context: Context) -> tuple[Parameter, ...]:
    ts, slow = context.record.sampling_interval_s, slowness(context)
    return (
        Parameter("natural", "s", 0.3 * ts, 5.0 * slow, ts, log=True),
        Parameter("damping", "ratio", _LEAST_DAMPING, 0.99, 0.3, log=True),
    )


def _pairs_of_poles(context: Context, _: FloatArray) -> FloatArray:
    ts, slow = context.record.sampling_interval_s, slowness(context)
    return grid(np.geomspace(max(0.1 * slow, 0.5 * ts), 1.5 * slow, 9), np.array([0.12, 0.3, 0.6]))


def swinging_behind_a_lag(plant: Plant, values: FloatArray, _: Context) -> Plant:
    """The poles in place of the first lag alone: a second one stays behind them."""
    tau, damping = values.tolist()
    return plant.changed(tau=tau, damping=damping, tau2=0.0, tau3=float(np.hypot(plant.tau2, plant.tau3)))


def swinging(plant: Plant, values: FloatArray, _: Context) -> Plant:
    """The poles in place of both lags: two lags are the same process with a damping of 1 and more."""
    tau, damping = values.tolist()
    return plant.changed(tau=tau, damping=damping, tau2=0.0)


def _settles_without_swinging(context: Context) -> bool:
    """A given simulation that swings has its own poles fitted: they are not missing."""
    return settles(context) and context.plant.damping == 0.0


def _has_two_lags(context: Context) -> bool:
    return _settles_without_swinging(context) and context.plant.tau2 > 0.0


def _has_a_resonance(values: FloatArray, _: Context) -> bool:
    return bool(values[1] < _RESONANT)


_BEHIND_A_LAG = Block(
    "process.resonance",
    "process",
    "process",
    ALWAYS,
    _poles,
    _pairs_of_poles,
    alter=swinging_behind_a_lag,
    penalty=18.0,
    sensible=_has_a_resonance,
    suits=_settles_without_swinging,
)
BLOCKS = (_BEHIND_A_LAG, replace(_BEHIND_A_LAG, form="both-lags", alter=swinging, suits=_has_two_lags))
