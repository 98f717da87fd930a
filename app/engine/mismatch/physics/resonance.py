"""A process that swings by itself: complex poles in place of the lag, as of a mass on a spring or a loop inside.

natural^2 x'' + 2 damping natural x' + x = K v + b, one over the natural frequency and the damping ratio fitted; below
a damping of 1 / sqrt(2) the process has a resonance.
Source: Seborg, Edgar, Mellichamp, Process Dynamics and Control, ISBN 978-1-119-28591-5, chapter 5.
"""

import numpy as np
from numba import njit

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.loop.plant import Plant, delay, lag
from app.engine.mismatch.physics.process_dynamics import ALWAYS, settles
from app.engine.mismatch.physics.scales import slowness
from app.engine.recording import FloatArray

LEAST_DAMPING, RESONANT = 0.02, 0.7071


@njit(cache=True, nogil=True)
def _swing(drive: FloatArray, start: float, natural: float, damping: float, ts: float) -> FloatArray:
    """x (N,) from rest at `start`, its drive held over each sample: exact."""
    out = np.empty(len(drive))
    decay, turn = damping / natural, np.sqrt(1.0 - damping * damping) / natural
    shrunk, c, s = np.exp(-decay * ts), np.cos(turn * ts), np.sin(turn * ts)
    x, speed = start, 0.0
    out[0] = x
    for t in range(1, len(drive)):
        away = x - drive[t - 1]
        push = (speed + decay * away) / turn
        x = drive[t - 1] + shrunk * (away * c + push * s)
        speed = shrunk * ((push * turn - decay * away) * c - (away * turn + decay * push) * s)
        out[t] = x
    return out


def poles(context: Context) -> tuple[Parameter, ...]:
    ts, slow = context.record.sampling_interval_s, slowness(context)
    return (
        Parameter("natural", "s", 0.3 * ts, 5.0 * slow, ts, log=True),
        Parameter("damping", "ratio", LEAST_DAMPING, 0.99, 0.3, log=True),
    )


def pairs_of_poles(context: Context, _: FloatArray) -> FloatArray:
    ts, slow = context.record.sampling_interval_s, slowness(context)
    return grid(np.geomspace(max(0.1 * slow, 0.5 * ts), 1.5 * slow, 9), np.array([0.12, 0.3, 0.6]))


def swinging(v: FloatArray, plant: Plant, values: FloatArray, context: Context) -> FloatArray:
    """PV (N,) of a valve position v (N,), both as deviations."""
    ts = context.record.sampling_interval_s
    drive = plant.K * delay(v, plant.theta, ts) + plant.b
    x = _swing(drive, plant.x0, float(values[0]), float(values[1]), ts)
    return lag(x, float(np.hypot(plant.tau2, plant.tau3)), ts)


def has_a_resonance(values: FloatArray, _: Context) -> bool:
    return bool(values[1] < RESONANT)


BLOCKS = (
    Block(
        "process.resonance",
        "process",
        "process",
        ALWAYS,
        poles,
        pairs_of_poles,
        replaces=swinging,
        penalty=18.0,
        sensible=has_a_resonance,
        suits=settles,
    ),
)
