"""Blind cases: a loop of random plant, controller, units and noise, with one concealed effect, two, or none, and the
truth.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from app.engine.recording import FloatArray
from tests.proof.plants import Controller, Process, Sensor, Valve, softplus

SAME = {
    "process.extra_lag": ("process.extra_lag", "sensor.lag"),
    "sensor.lag": ("sensor.lag", "process.extra_lag"),
    "valve.characteristic": ("valve.characteristic", "process.nonlinear_gain"),
    "process.nonlinear_gain": ("process.nonlinear_gain", "valve.characteristic"),
    "disturbance.step": ("disturbance.step", "sensor.step"),
    "sensor.step": ("sensor.step", "disturbance.step"),
    "sensor.drift": ("sensor.drift", "disturbance.ramp"),
    "disturbance.ramp": ("disturbance.ramp", "sensor.drift"),
    "process.outflow_law": ("process.outflow_law", "process.nonlinear_gain"),
}
EFFECTS = (
    "valve.stiction", "valve.deadband", "valve.slew_limit", "valve.saturation", "valve.characteristic",
    "process.dead_time", "process.extra_lag", "process.integrating", "process.nonlinear_gain", "process.outflow_law",
    "process.gain_drift", "process.friction", "process.overflow", "process.inverse_response", "sensor.lag",
    "sensor.quantization",
    "sensor.saturation", "sensor.drift", "sensor.stuck", "sensor.step", "disturbance.oscillation",
    "disturbance.step", "disturbance.ramp", "disturbance.coupling",
)  # fmt: skip
NEED_SELF_REGULATION = ("process.integrating", "process.outflow_law")
NEED_A_MASS = ("process.friction",)
LEAST_ENERGY = 60.0


@dataclass
class Loop:
    """What a case is made of; the effects change it. Signals in units of a loop with PV 0..1-like span before
    scaling.
    """

    n: int
    ts: float
    process: Process
    controller: Controller
    sp: FloatArray
    load: FloatArray
    white: FloatArray
    aux: FloatArray
    speed: float
    op_scale: float
    valve: Valve = field(default_factory=Valve)
    sensor: Sensor = field(default_factory=Sensor)
    reading: list[tuple[str, float]] = field(default_factory=list)
    added: FloatArray | None = None
    load_added: FloatArray | None = None
    gain_profile: FloatArray | None = None
    curve: float = 0.0
    sensor_tau: float = 0.0
    limit: float = math.inf
    softness: float = 0.0
    stuck: tuple[int, int] | None = None
    step_size: float = 0.0
    sizes: dict[str, float] = field(default_factory=dict)


@dataclass
class Truth:
    """The concealed effects and what is right to say. noise: (N,) what the true model leaves of PV, in its unit. sizes:
    by the engine's names, in its units; those of a valve, and of an effect alone in its own form.
    """

    effects: tuple[str, ...]
    windows: tuple[tuple[float, float], ...] = ()
    localise: bool = False
    energy: float = 0.0
    noise: FloatArray | None = None
    sizes: dict[str, float] = field(default_factory=dict)


@dataclass
class Case:
    """A blind case: columns of equal length and the truth."""

    name: str
    ts: float
    sp: FloatArray
    op: FloatArray
    pv: FloatArray
    trace: FloatArray
    measured: tuple[tuple[str, FloatArray], ...]
    truth: Truth


@dataclass
class Run:
    """Signals of a simulated loop: what was recorded, and the clean PV before noise."""

    op: FloatArray
    pv: FloatArray
    clean: FloatArray
    stem: FloatArray


def coloured(rng: Generator, n: int, pole: float, size: float, kind: str) -> FloatArray:
    e = {"gauss": rng.standard_normal, "heavy": lambda k: rng.standard_t(4, k) / math.sqrt(2.0),
         "uniform": lambda k: rng.uniform(-1.73, 1.73, k)}[kind](n)  # fmt: skip
    out = np.zeros(n)
    for t in range(1, n):
        out[t] = pole * out[t - 1] + math.sqrt(1.0 - pole * pole) * e[t]
    return size * out


def set_points(rng: Generator, n: int, speed: float, kind: str) -> FloatArray:
    sp = np.zeros(n)
    if kind == "constant":
        return sp
    at, level = int(5 + 4 * speed), 0.0
    while at < n:
        level = float(rng.uniform(-9.0, 9.0))
        sp[at:] = level
        at += int(rng.uniform(8.0, 22.0) * speed)
    if kind == "ramps":
        width = max(int(4 * speed), 1)
        sp = np.convolve(np.concatenate((np.zeros(width - 1), sp)), np.ones(width) / width, "valid")
    return sp


def make_loop(rng: Generator, foreign: bool, samples: int | None = None) -> Loop:
    """A random loop. speed: samples of its slowest time constant. samples: how long it runs; None: 1,500 to 2,400."""
    ts = float(rng.choice([0.5, 1.0, 2.0, 5.0, 10.0, 30.0, 60.0])) if foreign else 1.0
    usual = int(rng.choice([1500, 2000, 2400])) if foreign else 2400
    n = usual if samples is None else samples
    kind = str(rng.choice(["first", "first", "second", "integrating"])) if foreign else "first"
    speed = float(rng.uniform(8.0, 28.0))
    tau, theta = speed * ts, float(rng.integers(1, 7)) * ts
    gain = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.55, 1.5))
    taus = {"first": (tau,), "second": (tau, tau * rng.uniform(0.2, 0.7)), "integrating": (0.15 * tau,)}[kind]
    integrating = kind == "integrating"
    process = Process(gain / tau if integrating else gain, tuple(taus), theta, integrating, ts)
    lam = float(rng.uniform(1.0, 2.5)) * (theta + 0.3 * tau + sum(taus[1:]))
    kc = tau / (gain * (lam + theta))
    ti = min(tau, 4.0 * (lam + theta)) if not integrating else 4.0 * (lam + theta)
    td = float(rng.uniform(0.1, 0.3)) * theta if foreign and rng.random() < 0.3 else 0.0
    controller = Controller(kc, ti, td, ts, 0.0, -45.0, 45.0)
    kinds = ["gauss", "gauss", "heavy", "uniform"] if foreign else ["gauss"]
    pole = float(np.clip(1.0 - 1.0 / (speed * rng.uniform(0.3, 2.0)), 0.5, 0.985)) if foreign else 0.95
    load = coloured(rng, n, pole, float(rng.uniform(0.2, 0.9)), str(rng.choice(kinds)))
    white = coloured(rng, n, 0.0, float(rng.uniform(0.06, 0.2)), str(rng.choice(kinds)))
    wanted = str(rng.choice(["steps", "steps", "steps", "ramps", "constant"])) if foreign else "steps"
    sp = set_points(rng, n, speed, wanted)
    if integrating:
        load = load * 0.15
    if wanted == "constant":
        load = 3.0 * load
    aux = coloured(rng, n, 0.97, 2.0, "gauss")
    return Loop(n, ts, process, controller, sp, load / (tau if integrating else 1.0), white, aux, speed, 1.0)


def run(loop: Loop, op: FloatArray | None = None, noisy: bool = True) -> Run:
    """The loop closed, or with `op` given, open along it."""
    n = loop.n
    recorded_op, pv, clean, stem = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    y = sensed = 0.0
    for t in range(n):
        level = y + (0.0 if loop.added is None else loop.added[t])
        if loop.sensor_tau > 0.0:
            sensed += (1.0 - math.exp(-loop.ts / loop.sensor_tau)) * (level - sensed)
            level = sensed
        level = loop.sensor.step(level)
        reading = loop.sensor.show(limited(level + (loop.white[t] if noisy else 0.0), loop))
        if loop.step_size > 0.0:
            reading = loop.step_size * round(reading / loop.step_size)
        if loop.stuck is not None and loop.stuck[0] <= t < loop.stuck[1]:
            reading = pv[loop.stuck[0] - 1]
        pv[t], clean[t] = reading, level
        recorded_op[t] = op[t] if op is not None else loop.controller.step(float(loop.sp[t]), reading)
        stem[t] = loop.valve.step(recorded_op[t])
        drive = stem[t] * (1.0 if loop.gain_profile is None else loop.gain_profile[t])
        drive *= 1.0 + loop.curve * y
        load = (loop.load[t] if noisy else 0.0) + (0.0 if loop.load_added is None else loop.load_added[t])
        y = loop.process.step(float(drive), float(load))  # plain numbers: numpy's take four times as long, one by one
    return Run(recorded_op, pv, clean, stem)


def limited(level: float, loop: Loop) -> float:
    if loop.limit == math.inf:
        return level
    if loop.softness <= 0.0:
        return min(level, loop.limit)
    return loop.limit - loop.softness * softplus((loop.limit - level) / loop.softness)
