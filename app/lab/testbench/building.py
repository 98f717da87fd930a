"""From a case to the record of a simulated loop, and what its valve really did."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.oscillation import detect
from app.engine.recording import FloatArray, Recording
from app.engine.simulate import (
    LoopSpec,
    OneParameterValve,
    PhysicalActuator,
    Plant,
    Signal,
    SimulatedLoop,
    TwoParameterValve,
    Valve,
    Wave,
    first_order,
    integrator,
    keep,
    rebuild,
    second_order,
    simulate_loop,
)
from app.engine.simulate.actuator import LinearValve
from app.engine.valve import CLASSIC
from app.lab.testbench.case import Case
from app.lab.testbench.tuning import tuned

_STEPS_PER_TIME_CONSTANT = 25
_LOOK_S_PER_TIME_CONSTANT = 400.0
_FEWEST_SAMPLES, _MOST_SAMPLES = 200, 6000
_REVERSALS = 6
# What every plant has beside the factors, in per cent of span: noise of the instrument, wandering of the load.
_NOISE_PCT, _LOAD_PCT = 0.03, 0.1


@dataclass(frozen=True, eq=False)
class Built:
    """A record, and whether its valve was exercised: changed its direction often enough to show what it is."""

    recording: Recording
    exercised: bool
    loop: SimulatedLoop


@dataclass(frozen=True)
class _Clock:
    """Slowest time constant and dead time together, and the dead time, in s."""

    slowest_s: float
    dead_s: float


def build(case: Case) -> Built:
    """Simulates the case: once without noise for its period and its movement, then as it would be recorded.

    Raises DataError where the loop runs away.
    """
    rng = np.random.default_rng(case.seed)
    clock = _clock(case, rng)
    spec = _spec(case, clock, rng)
    look = _look(spec, clock)
    period_s = _period_s(look, clock)
    loop = _recorded(case, spec, clock, period_s, float(np.std(look.true_pv)))
    return Built(_historian(case, loop.recording("bench")), _exercised(case, loop), loop)


def _clock(case: Case, rng: np.random.Generator) -> _Clock:
    tau_s = float(10 ** rng.uniform(0.5, 2.5))
    low, high = {"fast_flow": (0.02, 0.06), "dead_time": (1.0, 4.0)}.get(case.plant, (0.1, 0.6))
    dead_s = tau_s * float(rng.uniform(low, high))
    return _Clock(tau_s + dead_s, dead_s)


def _plant(case: Case, clock: _Clock) -> Plant:
    tau_s = clock.slowest_s - clock.dead_s
    if case.plant == "level":
        return integrator(1.0 / tau_s, clock.dead_s)
    if case.plant == "lagging_level":
        return integrator(1.0 / tau_s, clock.dead_s, 0.4 * tau_s)
    if case.plant == "second_order":
        return second_order(1.0, 0.6 * tau_s, 1.2, clock.dead_s)
    if case.plant == "underdamped":
        return second_order(1.0, 0.5 * tau_s, 0.35, clock.dead_s)
    return first_order(1.0, tau_s, clock.dead_s)


def _spec(case: Case, clock: _Clock, rng: np.random.Generator) -> LoopSpec:
    plant = _plant(case, clock)
    tightness = float(rng.uniform(1.0, 1.1)) if case.cause == "tight" else case.tightness
    load, upset = _disturbances(case, clock, rng)
    low, high = _op_limits(case)
    return LoopSpec(
        plant=plant,
        controller=tuned(plant, case.controller, clock.slowest_s, tightness),
        valve=_valve(case),
        sp=_set_point(case, clock, rng),
        load=load,
        upset=upset,
        pv_start=50.0,
        op_start=50.0,
        op_limits=(low, high),
        settle_s=60.0 * clock.slowest_s,
    )


def _op_limits(case: Case) -> tuple[float, float]:
    """Where nothing else bounds a loop beyond the limit of stability, or where OP is to saturate, OP does it."""
    reach = {"tight": case.size_pct, "saturated": 0.5 * case.size_pct}.get(case.cause, 50.0)
    return 50.0 - reach, 50.0 + reach


def _valve(case: Case) -> Valve:
    S, J = case.size_pct, case.J_ratio * case.size_pct
    if not case.sticky:
        return LinearValve()
    if case.valve == "one_parameter":
        return OneParameterValve(S / 2.0)
    if case.valve == "physical":
        friction_pct = 100.0 * (CLASSIC.F_s + CLASSIC.F_c) / (CLASSIC.k * CLASSIC.travel_m)
        return PhysicalActuator(CLASSIC, op_per_pct=S / friction_pct)
    return TwoParameterValve(S, J, case.valve)


def _disturbances(case: Case, clock: _Clock, rng: np.random.Generator) -> tuple[Signal, Signal]:
    """Load (acts where the valve does) and upset (adds to PV)."""
    size, slow_s = case.size_pct, clock.slowest_s * float(10 ** rng.uniform(0.3, 1.3))
    background = case.load_share * size + _LOAD_PCT
    if case.sticky:
        kick = 0.6 * size * float(rng.choice([-1.0, 1.0]))
        return replace(_moving(case.load, case.load_share * size, clock, rng), value=kick), Signal()
    calm = Signal(noise_sd=background, noise_tau_s=slow_s)
    if case.cause in ("sine", "saturated"):
        wave = _moving("sine", size, clock, rng)
        return (calm, wave) if rng.random() < 0.5 else (replace(calm, waves=wave.waves), Signal())
    if case.cause == "coloured":
        return Signal(noise_sd=size, noise_tau_s=slow_s), Signal()
    if case.cause == "steps":
        return replace(calm, steps=_moving("steps", size, clock, rng).steps), Signal()
    return calm, Signal()


def _moving(kind: str, size: float, clock: _Clock, rng: np.random.Generator) -> Signal:
    background = Signal(noise_sd=_LOAD_PCT, noise_tau_s=8.0 * clock.slowest_s)
    if kind == "sine":
        period_s = clock.slowest_s * float(10 ** rng.uniform(0.6, 1.5))
        return replace(background, waves=(Wave(size, period_s, "sine", float(rng.uniform(0.0, 6.28))),))
    if kind == "steps":
        return replace(background, steps=random_steps(size, 25.0 * clock.slowest_s, rng))
    slow_s = clock.slowest_s * float(10 ** rng.uniform(0.3, 1.3))
    return Signal(noise_sd=float(np.hypot(size, _LOAD_PCT)), noise_tau_s=slow_s)


def random_steps(
    size: float, apart_s: float, rng: np.random.Generator, count: int = 40
) -> tuple[tuple[float, float], ...]:
    """Steps between levels of that size (standard deviation) around zero, so that they do not wander off."""
    levels = np.concatenate(([0.0], size * rng.standard_normal(count)))
    times = np.cumsum(rng.exponential(apart_s, count)) - 2.0 * apart_s
    return tuple(zip(times.tolist(), np.diff(levels).tolist(), strict=True))


def _set_point(case: Case, clock: _Clock, rng: np.random.Generator) -> Signal:
    size = case.size_pct
    if case.cause == "set_point":
        form = str(rng.choice(["sine", "square", "triangle"]))
        return Signal(waves=(Wave(size, clock.slowest_s * float(rng.uniform(15.0, 50.0)), form),))  # type: ignore[arg-type]
    if case.set_point == "few_steps":
        return Signal(steps=random_steps(size, 100.0 * clock.slowest_s, rng, 4))
    if case.set_point == "many_steps":
        return Signal(steps=random_steps(size, 20.0 * clock.slowest_s, rng))
    if case.set_point == "sine":
        return Signal(waves=(Wave(size, 40.0 * clock.slowest_s),))
    if case.set_point == "ramp":
        return Signal(drift_per_s=size / (40.0 * clock.slowest_s) / 4.0)
    return Signal()


def _look(spec: LoopSpec, clock: _Clock) -> SimulatedLoop:
    step_s = clock.slowest_s / _STEPS_PER_TIME_CONSTANT
    return simulate_loop(spec, _LOOK_S_PER_TIME_CONSTANT * clock.slowest_s, step_s, seed=1)


def _period_s(look: SimulatedLoop, clock: _Clock) -> float:
    found = detect(look.uniform())
    return found.period_s if found.period_s is not None else 15.0 * clock.slowest_s


def _recorded(case: Case, spec: LoopSpec, clock: _Clock, period_s: float, movement: float) -> SimulatedLoop:
    interval_s = period_s / case.points_per_cycle
    finest_s = clock.slowest_s / _STEPS_PER_TIME_CONSTANT
    samples = int(np.clip(case.cycles * case.points_per_cycle, _FEWEST_SAMPLES, _MOST_SAMPLES))
    resolution = 1.2 * case.size_pct if case.cause == "quantised" else case.resolution_share * movement
    noisy = replace(
        spec,
        noise=Signal(noise_sd=float(np.hypot(case.noise_share * movement, _NOISE_PCT))),
        pv_resolution=resolution,
        step_s=interval_s / int(np.ceil(interval_s / finest_s)),
    )
    return simulate_loop(noisy, samples * interval_s, interval_s, case.seed)


def _historian(case: Case, recording: Recording) -> Recording:
    recorder = case.recorder
    if recorder == "none":
        return recording

    def stored(x: FloatArray) -> FloatArray:
        band = case.recorder_share * float(np.std(x))
        return rebuild(recording.time_s, x, keep(recording.time_s, x, band, recorder), recorder)

    return replace(recording, pv=stored(recording.pv), op=stored(recording.op))


def _exercised(case: Case, loop: SimulatedLoop) -> bool:
    if not case.sticky:
        return True
    moved = np.diff(loop.v)
    directions = np.sign(moved[np.abs(moved) > 1e-3 * case.size_pct])
    return int(np.count_nonzero(np.diff(directions))) >= _REVERSALS
