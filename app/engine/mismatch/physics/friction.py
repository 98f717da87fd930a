"""Dry (Coulomb) and viscous friction in a moving mass: it stays where it is until the drive exceeds the dry friction,
and is slowed while it moves.

On an integrator, PV is the place of a driven mass: tau2 v' = K u + b - (1 + c) v - F sgn(v), x' = v. With two lags it
is a mass on a spring: tau tau2 x'' + (1 + c) (tau + tau2) x' + x = K u + b - F sgn(x'); so it is where the process
swings, with tau^2 and 2 damping tau for tau tau2 and tau + tau2. With one lag PV is the speed
itself: tau v' = K u + b - (1 + c) v - F sgn(v), resting at PV = 0. F in the unit of the drive K u. At rest |drive| <= F
holds the mass. What is too light to swing before a further lag, which PV is behind: tau x' = K u + b - x - F sgn(x').
Source: Armstrong-Helouvry, Dupont, Canudas de Wit 1994, doi 10.1016/0005-1098(94)90209-7; the switch at rest is
Karnopp's 1985, doi 10.1115/1.3140698.
"""

import numpy as np
from numba import njit

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.loop.plant import Plant, delay, lag
from app.engine.recording import BoolArray, FloatArray

_STEPS = 4
_LIGHT = 0.02
_AT_REST = 0.02
_LEAST_OF_FORCE = 0.25


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
    """x (N,) of the mass; drive: K, b, spring (0 or 1); numbers: start, its speed, dry, damping, mass."""
    K, b, spring = drive
    x, speed, dry, damping, mass = numbers
    y = np.empty(len(u))
    h = ts / _STEPS
    stay = np.exp(-damping * h / mass)
    y[0] = x
    for t in range(1, len(u)):
        for _ in range(_STEPS):
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
    stay = np.exp(-damping * ts / _STEPS / tau)
    y[0] = x
    for t in range(1, len(u)):
        for _ in range(_STEPS):
            speed = _speed_after(speed, K * u[t - 1] + b - rest, dry, damping, stay)
        y[t] = rest + speed
    return y


def _has_one_lag(plant: Plant) -> bool:
    """Whether PV of a plant is a speed: it neither integrates nor swings nor has a second lag."""
    return plant.leak > 0.0 and plant.tau2 <= 0.0 and plant.damping == 0.0


def _run(v: FloatArray, plant: Plant, values: FloatArray, context: Context) -> FloatArray:
    """PV (N,) of the mass, behind the further lags that another block may have given the plant."""
    further = _further_lag(plant, context)
    own = plant.changed(tau2=plant.tau2 - further)
    return _behind(_moved(v, own, values, context), further, plant.tau3, context.record.sampling_interval_s)


def _further_lag(plant: Plant, context: Context) -> float:
    """The second lag, s, that another block gave a plant that has one: it makes no spring of a speed."""
    return plant.tau2 if _one_lag(context) else 0.0


def _behind(pv: FloatArray, lag_s: float, last_s: float, ts: float) -> FloatArray:
    return lag(lag(pv, lag_s, ts), last_s, ts)


def _moved(v: FloatArray, plant: Plant, values: FloatArray, context: Context) -> FloatArray:
    """PV (N,) as deviation, of the mass that v (N,) drives `theta` later, by the equations above for the plant's lags.

    v: unit of OP, as deviation. values: dry friction F in the unit of the drive K v, and the share c by which viscous
    friction adds to what slows the mass anyway.
    """
    ts = context.record.sampling_interval_s
    u = delay(v, plant.theta, ts)
    dry, more = float(values[0]), 1.0 + float(values[1])
    if _has_one_lag(plant):
        drive = np.array([plant.K, plant.b, -context.record.pv_mid])
        return _speed(u, drive, np.array([plant.x0, dry, more, plant.tau]), ts)
    drive = np.array([plant.K, plant.b, plant.leak])
    if plant.damping > 0.0:
        slowed = more * 2.0 * plant.damping * plant.tau
        return _place(u, drive, np.array([plant.x0, plant.speed0 / plant.tau, dry, slowed, plant.tau**2]), ts)
    if plant.leak == 0.0:
        return _place(u, drive, np.array([plant.x0, 0.0, dry, more, max(plant.tau2, _LIGHT * ts)]), ts)
    second = max(plant.tau2, _LIGHT * ts)
    return _place(u, drive, np.array([plant.x0, 0.0, dry, more * (plant.tau + second), plant.tau * second]), ts)


@njit(cache=True, nogil=True)
def _sprung(force: FloatArray, x: float, dry: float, tau: float, ts: float) -> FloatArray:
    """x (N,) of what is too light to swing, from its start, under a force that is held: exact."""
    y = np.empty(len(force))
    move = 1.0 - np.exp(-ts / tau) if tau > 1e-9 else 1.0
    y[0] = x
    for t in range(1, len(force)):
        off = force[t - 1] - x
        if abs(off) > dry:
            x += move * (off - dry if off > 0.0 else off + dry)
        y[t] = x
    return y


def before_a_lag(v: FloatArray, plant: Plant, dry: float, own: float, further: float, ts: float) -> FloatArray:
    """PV (N,) behind a further lag, and before it what has the friction, with a time constant of its own; s."""
    return _behind(_sprung(_drive_of(v, plant, ts), plant.x0, dry, own, ts), further, plant.tau3, ts)


def _drive_of(v: FloatArray, plant: Plant, ts: float) -> FloatArray:
    return plant.K * delay(v, plant.theta, ts) + plant.b


def _holds(dry: float, own: float, context: Context) -> bool:
    """Whether dry friction is a good part of the force on what it holds, root mean square; far below it holds next to
    nothing: that is a further lag.
    """
    ts, plant = context.record.sampling_interval_s, context.plant
    force = _drive_of(context.record.op_deviation, plant, ts)
    left = force - _sprung(force, plant.x0, dry, own, ts)
    return bool(dry > _LEAST_OF_FORCE * np.sqrt(np.mean(left[:-1] ** 2)))


def _moves_a_mass(context: Context) -> bool:
    """A place (an integrator, or two lags), or a speed that comes to rest within the record."""
    if not _one_lag(context):
        return True
    pv, span = context.record.pv, context.record.pv_span
    return bool(np.min(np.abs(pv)) < 0.05 * span and np.mean(np.abs(pv) < _AT_REST * span) > _AT_REST)


def _reach(context: Context) -> float:
    """How far the drive K u moves, in its unit."""
    return abs(context.plant.K) * context.record.op_span


def _parameters(context: Context) -> tuple[Parameter, ...]:
    unit = "PV/s" if context.plant.leak == 0.0 else "PV"
    most = _reach(context)
    return (
        Parameter("dry_friction", unit, 0.003 * most, 2.0 * most, most, log=True),
        Parameter("viscous_share", "share of damping", -0.5, 3.0, 1.0),
    )


def _starts(context: Context, _: FloatArray) -> FloatArray:
    return grid(_reach(context) * np.geomspace(0.01, 0.8, 12), np.zeros(1))


def _at_rest(signal: FloatArray, _: FloatArray, context: Context) -> BoolArray:
    """Where the simulated mass does not move (for a speed: where it is zero)."""
    if _one_lag(context):
        return np.abs(signal + context.record.pv_mid) < 1e-9 * context.record.pv_span
    return np.concatenate(([False], np.abs(np.diff(signal)) < 1e-9 * context.record.pv_span))


def _two_lags(context: Context) -> bool:
    return context.plant.leak > 0.0 and context.plant.tau2 > 0.0


def _one_lag(context: Context) -> bool:
    return _has_one_lag(context.plant)


def _before_the_lag(v: FloatArray, plant: Plant, values: FloatArray, context: Context) -> FloatArray:
    """PV (N,) behind the plant's one lag, and before it what has the friction and a time constant of its own."""
    ts, (dry, own) = context.record.sampling_interval_s, values.tolist()
    return lag(before_a_lag(v, plant, dry, own, plant.tau, ts), _further_lag(plant, context), ts)


def _holds_before_the_lag(values: FloatArray, context: Context) -> bool:
    return _holds(float(values[0]), float(values[1]), context)


def _friction_and_time(context: Context) -> tuple[Parameter, ...]:
    ts, tau = context.record.sampling_interval_s, context.plant.tau
    return (*_dry_friction(context), Parameter("own_lag", "s", 0.1 * ts, max(3.0 * tau, ts), ts, log=True))


def _sizes_and_times(context: Context, _: FloatArray) -> FloatArray:
    ts, tau = context.record.sampling_interval_s, context.plant.tau
    return grid(_starts(context, _)[:, 0], np.array([0.5 * ts, max(0.3 * tau, ts)]))


def _dry_friction(context: Context) -> tuple[Parameter, ...]:
    return _parameters(context)[:1]


def _sizes(context: Context, _: FloatArray) -> FloatArray:
    return _starts(context, _)[:, :1]


def _before_a_lag(form: str, slow: bool) -> Block:
    def times(plant: Plant) -> list[float]:
        return sorted((plant.tau, plant.tau2), reverse=slow)

    def replaces(v: FloatArray, plant: Plant, values: FloatArray, context: Context) -> FloatArray:
        own, further = times(plant)
        return before_a_lag(v, plant, float(values[0]), own, further, context.record.sampling_interval_s)

    def sensible(values: FloatArray, context: Context) -> bool:
        return _holds(float(values[0]), times(context.plant)[0], context)

    return Block(
        "process.friction",
        "process",
        "process",
        "at reversals of what is driven",
        _dry_friction,
        _sizes,
        replaces=replaces,
        form=form,
        penalty=17.0,
        rough=True,
        sensible=sensible,
        suits=_two_lags,
    )


BLOCKS = (
    Block(
        "process.friction",
        "process",
        "process",
        "while the mass is at rest, and at its reversals",
        _parameters,
        _starts,
        replaces=_run,
        active=_at_rest,
        penalty=19.0,
        rough=True,
        suits=_moves_a_mass,
    ),
    _before_a_lag("before-a-lag", slow=True),
    _before_a_lag("before-a-slower-lag", slow=False),
    Block(
        "process.friction",
        "process",
        "process",
        "at reversals of what is driven",
        _friction_and_time,
        _sizes_and_times,
        replaces=_before_the_lag,
        form="before-the-lag",
        penalty=19.0,
        rough=True,
        sensible=_holds_before_the_lag,
        suits=_one_lag,
    ),
)
