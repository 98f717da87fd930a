"""Random simulated loops drawn by tightness and by points a cycle: levels, P and PID control, rougher records.

`known_loops` draws the tuning by time constants, as most real flows have it; here controllers go from sluggish to the
limit of stability, a third of the loops are levels, a quarter of these under P control, sticky valves work against
loads as large as S, and some records went through a historian. Sticky valves that hardly moved are left out.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from app.engine.oscillation import detect
from app.engine.recording import FloatArray, UniformRecord
from app.engine.simulate import (
    LoopSpec,
    Pid,
    Plant,
    Signal,
    SimulatedLoop,
    TwoParameterValve,
    Wave,
    first_order,
    integrator,
    keep,
    rebuild,
    second_order,
    simulate_loop,
)
from app.lab.testbench.building import random_steps
from app.lab.testbench.case import log_uniform
from app.lab.testbench.tuning import tuned

CAUSES = ("stiction", "tuning", "oscillation", "load", "steps", "saturation", "quantisation", "set_point", "quiet")
_CHANCES = (0.45, 0.07, 0.18, 0.08, 0.06, 0.03, 0.03, 0.07, 0.03)
_PLANTS = ("fast", "first", "second", "dead", "underdamped", "level", "lagging_level")
_PLANT_CHANCES = (0.15, 0.2, 0.15, 0.08, 0.07, 0.22, 0.13)
_LEVELS = ("level", "lagging_level")
_FEWEST_REVERSALS = 4
_LARGEST_TRAVEL = 40.0
_STEPS = 60


@dataclass(frozen=True)
class _Draw:
    """What is decided first. S, J in the unit of OP; slow_s: largest lag and dead time, in s."""

    cause: str
    kind: str
    S: float
    J: float
    slow_s: float

    @property
    def sticky(self) -> bool:
        return self.cause == "stiction"

    @property
    def level(self) -> bool:
        return self.kind in _LEVELS


def draw(rng: np.random.Generator) -> tuple[UniformRecord, str, float, float] | None:
    """A record with its cause, S and J; None where nothing moves or the valve was hardly exercised.

    Raises DataError where the loop runs away.
    """
    cause, kind = str(rng.choice(CAUSES, p=_CHANCES)), str(rng.choice(_PLANTS, p=_PLANT_CHANCES))
    tau_s = log_uniform(rng, 1.5, 60.0)
    dead_s = tau_s * log_uniform(rng, *{"fast": (0.02, 0.06), "dead": (1.0, 4.0)}.get(kind, (0.05, 0.8)))
    S = 1.0 if cause == "stiction" else 0.0
    J = S * float(rng.choice([0.0, rng.random(), 1.0, 1.3], p=[0.2, 0.5, 0.25, 0.05]))
    drawn = _Draw(cause, kind, S, J, tau_s + dead_s)
    spec = _spec(rng, drawn, _plant(rng, kind, tau_s, dead_s))
    loop = _recorded(rng, drawn, spec)
    pv, op = loop.pv, loop.op
    if np.ptp(op[len(op) // 4 :]) < 1e-6 or np.ptp(pv) < 1e-6 or (drawn.sticky and not _exercised(loop)):
        return None
    if rng.random() < 0.1:
        stored = _historian(rng, loop.time_s)
        pv, op = stored(pv), stored(op)
    return UniformRecord(1.0, pv, op, loop.sp, np.zeros(len(pv), dtype=np.bool_)), cause, S, J


def _plant(rng: np.random.Generator, kind: str, tau_s: float, dead_s: float) -> Plant:
    if kind in _LEVELS:
        lag_s = 0.0 if kind == "level" else tau_s * float(rng.uniform(0.1, 0.8))
        return integrator(1.0 / tau_s, dead_s, lag_s)
    if kind == "second":
        return second_order(1.0, 0.6 * tau_s, float(rng.uniform(1.0, 1.5)), dead_s)
    if kind == "underdamped":
        return second_order(1.0, 0.5 * tau_s, float(rng.uniform(0.3, 0.8)), dead_s)
    return first_order(1.0, tau_s, dead_s)


def _spec(rng: np.random.Generator, drawn: _Draw, plant: Plant) -> LoopSpec:
    disturbance = _disturbance(rng, drawn)
    at_valve = drawn.sticky or drawn.level or rng.random() < 0.6
    calm = Signal(noise_sd=0.02, noise_tau_s=5.0 * drawn.slow_s)
    limits = {"tuning": (-1.0, 1.0), "saturation": (-float(rng.uniform(0.0, 0.6)), 50.0)}
    spec = LoopSpec(
        plant=plant,
        controller=_controller(rng, drawn, plant),
        sp=_set_point(rng, drawn),
        load=disturbance if at_valve else calm,
        upset=Signal() if at_valve else disturbance,
        op_limits=limits.get(drawn.cause, (-50.0, 50.0)),
        settle_s=60.0 * drawn.slow_s,
    )
    if not drawn.sticky:
        return spec
    form = rng.choice(["he", "he", "choudhury", "kano"])
    return replace(spec, valve=TwoParameterValve(drawn.S, drawn.J, form))


def _controller(rng: np.random.Generator, drawn: _Draw, plant: Plant) -> Pid:
    kinds, chances = (("P", "PI", "PID"), (0.25, 0.65, 0.1)) if drawn.level else (("PI", "PID"), (0.88, 0.12))
    kind = str(rng.choice(kinds, p=chances))
    tightness = float(rng.uniform(1.0, 1.15)) if drawn.cause == "tuning" else log_uniform(rng, 0.04, 0.9)
    controller = tuned(plant, kind, drawn.slow_s, tightness)  # type: ignore[arg-type]
    if kind == "P":
        return controller
    return replace(controller, Ti_s=controller.Ti_s * log_uniform(rng, 0.35 if drawn.level else 0.5, 4.0))


def _disturbance(rng: np.random.Generator, drawn: _Draw) -> Signal:
    slow_s = drawn.slow_s
    calm = Signal(noise_sd=log_uniform(rng, 0.01, 0.3), noise_tau_s=slow_s * log_uniform(rng, 2.0, 20.0))
    if drawn.sticky:
        pushed = replace(calm, value=0.6 * float(rng.choice([-1.0, 1.0])))
        kind = str(rng.choice(["coloured", "waves", "steps", "calm"], p=[0.35, 0.15, 0.1, 0.4]))
        if kind == "coloured":
            return replace(pushed, noise_sd=log_uniform(rng, 0.1, 1.5))
        if kind == "waves":
            return replace(pushed, waves=_waves(rng, slow_s, log_uniform(rng, 0.1, 2.0)))
        if kind == "steps":
            return replace(pushed, steps=random_steps(log_uniform(rng, 0.1, 1.0), 25.0 * slow_s, rng, _STEPS))
        return pushed
    if drawn.cause in ("oscillation", "saturation"):
        return replace(calm, waves=_waves(rng, slow_s, 1.0))
    if drawn.cause == "steps":
        return replace(calm, steps=random_steps(1.0, slow_s * log_uniform(rng, 8.0, 60.0), rng, _STEPS))
    return replace(calm, noise_sd=1.0) if drawn.cause == "load" else calm


def _set_point(rng: np.random.Generator, drawn: _Draw) -> Signal:
    if drawn.cause != "set_point" and rng.random() >= 0.2:
        return Signal()
    size, slow_s = float(rng.uniform(0.3, 1.5)), drawn.slow_s
    kind = str(rng.choice(["steps", "waves", "noise"], p=[0.5, 0.25, 0.25]))
    if kind == "waves":
        return Signal(waves=_waves(rng, slow_s, size))
    if kind == "noise":
        return Signal(noise_sd=size, noise_tau_s=slow_s * log_uniform(rng, 3.0, 30.0))
    return Signal(steps=random_steps(size, slow_s * log_uniform(rng, 20.0, 200.0), rng, _STEPS))


def _waves(rng: np.random.Generator, slow_s: float, size: float) -> tuple[Wave, ...]:
    period_s, phase = slow_s * log_uniform(rng, 4.0, 40.0), float(rng.uniform(0.0, 6.28))
    form = rng.choice(["sine", "triangle", "square"], p=[0.6, 0.25, 0.15])
    waves = [Wave(size, period_s, form, phase)]
    if rng.random() < 0.4:
        waves.append(Wave(size * float(rng.uniform(0.0, 0.6)), period_s * float(rng.uniform(0.85, 1.2)), "sine", 1.0))
    if rng.random() < 0.3:
        waves.append(Wave(0.4 * size, period_s / 2.0, "sine", float(rng.uniform(0.0, 6.28))))
    return tuple(waves)


def _recorded(rng: np.random.Generator, drawn: _Draw, spec: LoopSpec) -> SimulatedLoop:
    """The loop as recorded: once without noise for its period and its movement, then with both."""
    finest_s = drawn.slow_s / 20.0
    look = simulate_loop(spec, 300.0 * drawn.slow_s, finest_s, seed=1)
    period_s = detect(look.uniform()).period_s or 15.0 * drawn.slow_s
    movement = float(np.std(look.true_pv)) or 1.0
    per_cycle, cycles = log_uniform(rng, 6.0, 150.0), log_uniform(rng, 4.0, 40.0)
    samples, interval_s = int(np.clip(per_cycle * cycles, 250, 1500)), period_s / per_cycle
    noise = movement * log_uniform(rng, 0.005, 0.6 if drawn.sticky else 0.9)
    seen = replace(
        spec,
        noise=Signal(noise_sd=noise, noise_tau_s=float(rng.choice([0.0, 0.0, 1.0])) * interval_s),
        step_s=interval_s / int(np.ceil(interval_s / finest_s)),
        pv_resolution=_resolution(rng, drawn, movement),
        op_resolution=float(np.std(look.op)) * log_uniform(rng, 0.01, 0.2) if rng.random() < 0.15 else 0.0,
    )
    return simulate_loop(seen, samples * interval_s, interval_s, int(rng.integers(2**31)))


def _resolution(rng: np.random.Generator, drawn: _Draw, movement: float) -> float:
    if drawn.cause == "quantisation":
        return 1.2 * movement * log_uniform(rng, 0.5, 2.0)
    return movement * log_uniform(rng, 0.02, 0.5) if rng.random() < 0.15 else 0.0


def _exercised(loop: SimulatedLoop) -> bool:
    moved = np.diff(loop.v)
    directions = np.sign(moved[np.abs(moved) > 1e-3])
    return int(np.count_nonzero(np.diff(directions))) >= _FEWEST_REVERSALS and float(np.ptp(loop.op)) <= _LARGEST_TRAVEL


def _historian(rng: np.random.Generator, time_s: FloatArray) -> Callable[[FloatArray], FloatArray]:
    kind = rng.choice(["exception", "swinging_door"])

    def stored(x: FloatArray) -> FloatArray:
        return rebuild(time_s, x, keep(time_s, x, log_uniform(rng, 0.05, 0.6) * float(np.std(x)), kind), kind)

    return stored
