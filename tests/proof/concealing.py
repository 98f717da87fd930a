"""How each effect is put into a loop: in the engine's own form, or (foreign) by other equations."""

import math
from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from app.engine.recording import FloatArray
from tests.proof.generator import Loop, coloured
from tests.proof.plants import (
    Backlash,
    ExactLags,
    FrictionValve,
    MovedMass,
    SlewValve,
    StaticValve,
    StickingValve,
    softplus,
)

Windows = tuple[tuple[float, float], ...]


def reach(loop: Loop) -> float:
    """How far OP moves in steady state, roughly: the set points' reach over the gain."""
    gain = abs(loop.process.gain) * (sum(loop.process.taus) / 0.15 if loop.process.integrating else 1.0)
    return 9.0 / max(gain, 1e-9) if np.ptp(loop.sp) > 0 else 3.0 / max(gain, 1e-9)


def tail(loop: Loop, start: int) -> Windows:
    return ((start * loop.ts, loop.n * loop.ts),)


def stiction(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    S = reach(loop) * float(rng.uniform(0.12, 0.4))
    J = S * float(rng.uniform(0.3, 0.9))
    model = str(rng.choice(["he", "kano", "choudhury", "friction"])) if foreign else "he"
    loop.valve = FrictionValve(S * 0.6, S * 0.2) if model == "friction" else StickingValve(model, S, J)
    return ()


def deadband(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    half = 0.5 * reach(loop) * float(rng.uniform(0.15, 0.4))
    loop.valve = Backlash(half, half * (float(rng.uniform(0.7, 1.3)) if foreign else 1.0))
    return ()


def slew(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    rate = reach(loop) / loop.speed * float(rng.uniform(0.1, 0.35))
    loop.sizes = {"rate": rate / loop.ts}
    loop.valve = SlewValve(rate, rate * (float(rng.uniform(0.8, 1.25)) if foreign else 1.0))
    return ()


def valve_saturation(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    side = float(rng.choice([-1.0, 1.0]))
    limit = reach(loop) * float(rng.uniform(0.1, 0.5))
    width = limit * float(rng.uniform(0.05, 0.25)) if foreign and rng.random() < 0.6 else 0.0

    def curve(u: float) -> float:
        over = side * u - limit
        if width <= 0.0:
            return side * min(side * u, limit)
        return side * (limit - width * softplus(-over / width))

    loop.valve, loop.sizes = StaticValve(curve), {"limit": side * limit}
    return (("op_beyond", side * limit),)  # type: ignore[return-value]


def characteristic(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    c = float(rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 2.2)) / (2.0 * reach(loop))
    r = reach(loop)

    def equal_percentage(u: float) -> float:
        return math.expm1(c * u) / c

    def hyperbolic(u: float) -> float:
        x = min(max(0.5 + u / (5.0 * r), 0.02), 0.98)
        a = 3.0 if c > 0 else 0.34
        return 5.0 * r * (x / math.sqrt(a + (1.0 - a) * x * x) - 0.5 / math.sqrt(a + (1.0 - a) * 0.25))

    loop.valve = StaticValve(hyperbolic if foreign and rng.random() < 0.5 else equal_percentage)
    return ()


def dead_time(loop: Loop, rng: Generator, _: bool) -> Windows:
    extra = loop.ts * float(rng.integers(2, 7)) if loop.speed < 18 else loop.ts * float(rng.integers(4, 10))
    loop.process.dead_time += extra
    loop.sizes = {"extra": extra}
    loop.process.__post_init__()
    return ()


def extra_lag(loop: Loop, rng: Generator, _: bool) -> Windows:
    tau = loop.ts * loop.speed * float(rng.uniform(0.3, 0.8))
    loop.process.taus, loop.sizes = (*loop.process.taus, tau), {"tau": tau}
    loop.process.__post_init__()
    return ()


def sensor_lag(loop: Loop, rng: Generator, _: bool) -> Windows:
    loop.sensor_tau = loop.ts * loop.speed * float(rng.uniform(0.3, 0.8))
    loop.sizes = {"tau": loop.sensor_tau}
    return ()


def integrating(loop: Loop, _: Generator, __: bool) -> Windows:
    process = loop.process
    process.gain, process.taus, process.integrating = process.gain / process.taus[0], process.taus[1:], True
    loop.load = loop.load / (loop.speed * loop.ts)
    process.__post_init__()
    return ()


def nonlinear_gain(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    size = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.25, 0.6))
    if foreign and rng.random() < 0.5:
        loop.curve = size / 9.0
    else:
        c = size / reach(loop)
        loop.valve = StaticValve(
            lambda u: u + c * u * u * 0.6 if not foreign else math.tanh(c * u) / c + 0.5 * c * u * u
        )
    return ()


def outflow(loop: Loop, rng: Generator, _: bool) -> Windows:
    loop.process.head = float(rng.uniform(10.0, 16.0))
    return ()


def friction(loop: Loop, rng: Generator, _: bool) -> Windows:
    process = loop.process
    dry = abs(process.gain) * reach(loop) * float(rng.uniform(0.1, 0.35))
    loop.process = MovedMass(process.gain, process.taus, process.dead_time, process.integrating, process.ts, dry=dry)
    return ()


def gain_drift(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    start = int(loop.n * rng.uniform(0.15, 0.55))
    change = float(rng.choice([-0.45, 0.5, 0.7]) * rng.uniform(0.8, 1.2))
    t = np.arange(loop.n)
    shape = np.clip((t - start) / (loop.n - start), 0.0, 1.0)
    if foreign and rng.random() < 0.6:
        shape = (
            np.where(t >= start, 1.0 - np.exp(-(t - start) / (0.15 * loop.n)), 0.0)
            if rng.random() < 0.5
            else (t >= start) * 1.0
        )
    loop.gain_profile = 1.0 + change * shape
    return tail(loop, start)


def overflow(loop: Loop, rng: Generator, _: bool) -> Windows:
    loop.process.high = float(rng.uniform(1.5, 4.0))
    return (("pv_full", loop.process.high),)  # type: ignore[return-value]


def inverse(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    slow = loop.speed * loop.ts
    p = loop.process
    if not p.integrating:
        p.taus = (*p.taus, 0.3 * slow)
    p.__post_init__()
    if not foreign:
        loop.process = ExactLags(p.gain, p.taus, p.dead_time, p.integrating, p.ts)
    loop.process.zero = slow * float(rng.uniform(0.35, 0.7))
    if not loop.process.integrating:
        loop.sizes = {"zero": loop.process.zero, "lag": 0.3 * slow}
    return ()


def quantization(loop: Loop, rng: Generator, _: bool) -> Windows:
    loop.step_size = float(rng.uniform(0.5, 1.3))
    return ()


def sensor_saturation(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    loop.limit = float(rng.uniform(1.5, 4.0))
    loop.sizes = {"limit": loop.limit}
    loop.softness = float(rng.uniform(0.05, 0.4)) if foreign and rng.random() < 0.4 else 0.0
    return (("clean_above", loop.limit),)  # type: ignore[return-value]


def shape_of_drift(loop: Loop, rng: Generator, foreign: bool, start: int) -> FloatArray:
    t = np.arange(loop.n)
    lasting = int(loop.n * rng.uniform(0.12, 0.35))
    loop.sizes = {"start": start * loop.ts, "lasting": lasting * loop.ts}
    if foreign and rng.random() < 0.5:
        return np.where(t >= start, 1.0 - np.exp(-(t - start) / (0.5 * lasting)), 0.0)
    return np.clip((t - start) / lasting, 0.0, 1.0)


def drift(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    start = int(loop.n * rng.uniform(0.15, 0.6))
    loop.added = float(rng.choice([-1.0, 1.0]) * rng.uniform(3.0, 6.0)) * shape_of_drift(loop, rng, foreign, start)
    loop.sizes["size"] = float(loop.added[-1])
    return tail(loop, start)


def load_ramp(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    start = int(loop.n * rng.uniform(0.15, 0.6))
    size = float(rng.choice([-1.0, 1.0]) * rng.uniform(3.0, 6.0)) / (
        loop.speed * loop.ts if loop.process.integrating else 1.0
    )
    loop.load_added = size * shape_of_drift(loop, rng, foreign, start)
    loop.sizes |= {} if loop.process.integrating else {"size": size}
    return tail(loop, start)


def sensor_step(loop: Loop, rng: Generator, _: bool) -> Windows:
    start = int(loop.n * rng.uniform(0.15, 0.8))
    loop.added = float(rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 4.0)) * (np.arange(loop.n) >= start)
    loop.sizes = {"start": start * loop.ts, "size": float(loop.added[-1])}
    return tail(loop, start)


def load_step(loop: Loop, rng: Generator, _: bool) -> Windows:
    start = int(loop.n * rng.uniform(0.15, 0.8))
    size = float(rng.choice([-1.0, 1.0]) * rng.uniform(2.5, 5.0)) / (
        loop.speed * loop.ts if loop.process.integrating else 1.0
    )
    loop.load_added = size * (np.arange(loop.n) >= start)
    loop.sizes = {"start": start * loop.ts} | ({} if loop.process.integrating else {"size": size})
    return tail(loop, start)


def oscillation(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    start = int(loop.n * rng.uniform(0.05, 0.3))
    end = int(loop.n * rng.uniform(0.6, 0.95))
    t = np.arange(loop.n)
    period = loop.speed * float(rng.uniform(1.5, 5.0))
    phase, loop.sizes = 2.0 * np.pi * t / period, {"period": period * loop.ts}
    wave = np.sin(phase)
    if foreign:
        wave = {"sine": wave, "square": np.sign(wave), "triangle": np.arcsin(wave) * 0.64}[
            str(rng.choice(["sine", "square", "triangle"]))
        ]
    added = float(rng.uniform(0.9, 2.0)) * wave * ((t >= start) & (t < end))
    loop.added = added
    return ((start * loop.ts, end * loop.ts),)


def coupling(loop: Loop, rng: Generator, foreign: bool) -> Windows:
    tau, late = loop.speed * float(rng.uniform(0.4, 1.5)), int(rng.integers(0, 6))
    out, x, second = np.zeros(loop.n), 0.0, 0.0
    for t in range(loop.n):
        x += (loop.aux[max(t - late, 0)] - x) / (1.0 + tau)
        second += (x - second) / (1.0 + 0.3 * tau) if foreign else x - second
        out[t] = second
    loop.added = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.7, 1.5)) * out
    return ()


def stuck(loop: Loop, rng: Generator, _: bool) -> Windows:
    start = int(loop.n * rng.uniform(0.1, 0.8))
    end = start + int(loop.n * rng.uniform(0.03, 0.09))
    loop.stuck = (start, end)
    return ((start * loop.ts, end * loop.ts),)


CONCEAL: dict[str, Callable[[Loop, Generator, bool], Windows]] = {
    "valve.stiction": stiction,
    "valve.deadband": deadband,
    "valve.slew_limit": slew,
    "valve.saturation": valve_saturation,
    "valve.characteristic": characteristic,
    "process.dead_time": dead_time,
    "process.extra_lag": extra_lag,
    "process.integrating": integrating,
    "process.nonlinear_gain": nonlinear_gain,
    "process.outflow_law": outflow,
    "process.gain_drift": gain_drift,
    "process.friction": friction,
    "process.overflow": overflow,
    "process.inverse_response": inverse,
    "sensor.lag": sensor_lag,
    "sensor.quantization": quantization,
    "sensor.saturation": sensor_saturation,
    "sensor.drift": drift,
    "sensor.stuck": stuck,
    "sensor.step": sensor_step,
    "disturbance.oscillation": oscillation,
    "disturbance.step": load_step,
    "disturbance.ramp": load_ramp,
    "disturbance.coupling": coupling,
}
__all__ = ["CONCEAL", "coloured"]
