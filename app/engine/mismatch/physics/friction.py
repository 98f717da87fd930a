"""Dry (Coulomb) and viscous friction in a moving mass: it stays where it is until the drive exceeds the dry friction,
and is slowed while it moves.

On an integrator, PV is the place of a driven mass: tau2 v' = K u + b - (1 + c) v - F sgn(v), x' = v. With two lags it
is a mass on a spring: tau tau2 x'' + (1 + c) (tau + tau2) x' + x = K u + b - F sgn(x'). With one lag PV is the speed
itself: tau v' = K u + b - (1 + c) v - F sgn(v), resting at PV = 0. F in the unit of the drive K u. At rest |drive| <= F
holds the mass. Source: Armstrong-Helouvry, Dupont, Canudas de Wit 1994, doi 10.1016/0005-1098(94)90209-7; the switch at
rest is Karnopp's 1985, doi 10.1115/1.3140698.
"""

import numpy as np
from numba import njit

from app.engine.mismatch.block import Block, Context, Parameter, grid
from app.engine.mismatch.plant import Plant, delay, lag
from app.engine.recording import BoolArray, FloatArray

STEPS = 4
LIGHT = 0.02
AT_REST = 0.02


@njit(cache=True, nogil=True)
def _speed_after(speed: float, force: float, dry: float, damping: float, stay: float) -> float:
    """The speed a step later under a force that is held: exact, at rest where dry friction holds.

    stay: exp(-damping step / mass), what is left of a speed that nothing drives.
    """
    if speed != 0.0:
        side = 1.0 if speed > 0.0 else -1.0
        settled = (force - dry * side) / damping
        after = settled + (speed - settled) * stay
        if after * side >= 0.0:
            return after
        # It comes to rest within the step; what is left of the step begins there.
        stay *= (settled - speed) / settled
    if abs(force) <= dry:
        return 0.0
    side = 1.0 if force > 0.0 else -1.0
    return (force - dry * side) / damping * (1.0 - stay)


@njit(cache=True, nogil=True)
def _place(u: FloatArray, drive: FloatArray, numbers: FloatArray, ts: float) -> FloatArray:
    """x (N,) of the mass; drive: K, b, spring (0 or 1); numbers: start, dry, damping, mass."""
    K, b, spring = drive
    x, dry, damping, mass = numbers
    y = np.empty(len(u))
    speed, h = 0.0, ts / STEPS
    stay = np.exp(-damping * h / mass)
    y[0] = x
    for t in range(1, len(u)):
        for _ in range(STEPS):
            # The spring as it is half a step on: taken where the mass was, it pushes the mass and hides its damping.
            pull = spring * (x + 0.5 * h * speed)
            after = _speed_after(speed, K * u[t - 1] + b - pull, dry, damping, stay)
            x += 0.5 * h * (speed + after)
            speed = after
        y[t] = x
    return y


@njit(cache=True, nogil=True)
def _speed(u: FloatArray, drive: FloatArray, numbers: FloatArray, ts: float) -> FloatArray:
    """PV (N,) where PV is the speed; drive: K, b, PV's deviation at rest; numbers: start, dry, damping, tau."""
    K, b, rest = drive
    x, dry, damping, tau = numbers
    y = np.empty(len(u))
    speed = x - rest
    stay = np.exp(-damping * ts / STEPS / tau)
    y[0] = x
    for t in range(1, len(u)):
        for _ in range(STEPS):
            speed = _speed_after(speed, K * u[t - 1] + b - rest, dry, damping, stay)
        y[t] = rest + speed
    return y


def run(v: FloatArray, plant: Plant, values: FloatArray, context: Context) -> FloatArray:
    """PV (N,) of the mass, behind the further lag that another block may have given the plant."""
    return lag(moved(v, plant, values, context), plant.tau3, context.record.sampling_interval_s)


def moved(v: FloatArray, plant: Plant, values: FloatArray, context: Context) -> FloatArray:
    ts = context.record.sampling_interval_s
    u = delay(v, plant.theta, ts)
    dry, more = float(values[0]), 1.0 + float(values[1])
    if plant.leak > 0.0 and plant.tau2 <= 0.0:
        drive = np.array([plant.K, plant.b, -context.record.pv_mid])
        return _speed(u, drive, np.array([plant.x0, dry, more, plant.tau]), ts)
    drive = np.array([plant.K, plant.b, plant.leak])
    if plant.leak == 0.0:
        return _place(u, drive, np.array([plant.x0, dry, more, max(plant.tau2, LIGHT * ts)]), ts)
    second = max(plant.tau2, LIGHT * ts)
    return _place(u, drive, np.array([plant.x0, dry, more * (plant.tau + second), plant.tau * second]), ts)


def moves_a_mass(context: Context) -> bool:
    """A place (an integrator, or two lags), or a speed that comes to rest within the record."""
    if context.plant.leak == 0.0 or context.plant.tau2 > 0.0:
        return True
    pv, span = context.record.pv, context.record.pv_span
    return bool(np.min(np.abs(pv)) < 0.05 * span and np.mean(np.abs(pv) < AT_REST * span) > AT_REST)


def reach(context: Context) -> float:
    """How far the drive K u moves, in its unit."""
    return abs(context.plant.K) * context.record.op_span


def parameters(context: Context) -> tuple[Parameter, ...]:
    unit = "PV/s" if context.plant.leak == 0.0 else "PV"
    most = reach(context)
    return (
        Parameter("dry_friction", unit, 0.003 * most, 2.0 * most, most, log=True),
        Parameter("viscous_share", "share of damping", -0.5, 3.0, 1.0),
    )


def starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(reach(context) * np.geomspace(0.01, 0.8, 12), np.zeros(1))


def at_rest(signal: FloatArray, _: FloatArray, context: Context) -> BoolArray:
    """Where the simulated mass does not move (for a speed: where it is zero)."""
    if context.plant.leak > 0.0 and context.plant.tau2 <= 0.0:
        return np.abs(signal + context.record.pv_mid) < 1e-9 * context.record.pv_span
    return np.concatenate(([False], np.abs(np.diff(signal)) < 1e-9 * context.record.pv_span))


BLOCKS = (
    Block(
        "process.friction",
        "process",
        "process",
        "while the mass is at rest, and at its reversals",
        parameters,
        starts,
        replaces=run,
        active=at_rest,
        penalty=19.0,
        rough=True,
        suits=moves_a_mass,
    ),
)
