"""Random simulated loops whose cause is known: what the verdict's shape network is trained on.

Flows to levels, sluggish to aggressive controllers, sticky valves from pure deadband to pure stick-slip, and rivals:
outside oscillations, wandering loads, tight tuning, saturation, quantisation, moving set points. Sticky loops are drawn
with S = 1 in the unit of OP, the others with disturbances of that size, so that nothing but the shape tells them apart.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from app.engine.recording import UniformRecord
from app.engine.simulate import (
    LoopSpec,
    Pid,
    Plant,
    Signal,
    TwoParameterValve,
    Wave,
    first_order,
    integrator,
    second_order,
    simulate_loop,
)
from app.errors import DataError
from app.lab.testbench import wide_plants

CAUSES = ("stiction", "tuning", "oscillation", "load", "saturation", "quantisation", "set_point", "quiet")
_CHANCES = (0.43, 0.07, 0.16, 0.13, 0.03, 0.03, 0.12, 0.03)
_WIDE = (1, 3, 5, 7)
_LARGEST_SWING = 60.0
_LEAST_TRAVEL, _MOST_TRAVEL = 1.05, 25.0


@dataclass(frozen=True, eq=False)
class KnownLoop:
    """A simulated record with its cause and, for sticky valves, the true S and J in the unit of OP."""

    record: UniformRecord
    cause: str
    S: float
    J: float


def known_loops(count: int, seed: int) -> Iterator[KnownLoop]:
    """`count` loops, four of nine as `wide_plants` draws them; the same seed gives the same loops."""
    rng = np.random.default_rng(seed)
    made = 0
    while made < count:
        loop = _draw_wide(rng) if made % 9 in _WIDE else _draw(rng)
        if loop is not None:
            made += 1
            yield loop


def _draw_wide(rng: np.random.Generator) -> KnownLoop | None:
    try:
        drawn = wide_plants.draw(rng)
    except DataError:
        return None
    return None if drawn is None else KnownLoop(*drawn)


def _draw(rng: np.random.Generator) -> KnownLoop | None:
    cause = str(rng.choice(CAUSES, p=_CHANCES))
    S = 1.0 if cause == "stiction" else 0.0
    J = S * float(rng.choice([0.0, rng.random(), 1.0], p=[0.2, 0.5, 0.3]))
    spec = _spec(rng, cause, S, J)
    samples = int(rng.choice([500, 750, 1000, 1500]))
    try:
        loop = simulate_loop(spec, float(samples), 1.0, int(rng.integers(2**31)))
    except DataError:
        return None
    record = loop.uniform()
    if not _believable(record, cause):
        return None
    return KnownLoop(record, cause, S, J)


def _believable(record: UniformRecord, cause: str) -> bool:
    travelled = float(np.ptp(record.op[record.samples // 4 :]))
    if travelled < 1e-6 or float(np.ptp(record.pv)) < 1e-6 or float(np.ptp(record.pv)) > _LARGEST_SWING:
        return False
    return cause != "stiction" or _LEAST_TRAVEL < travelled < _MOST_TRAVEL


def _spec(rng: np.random.Generator, cause: str, S: float, J: float) -> LoopSpec:
    tau = float(10 ** rng.uniform(-0.7, 1.5))
    theta = tau * float(10 ** rng.uniform(-1.3, 0.2)) + (1.0 if rng.random() < 0.3 else 0.0)
    integrating = bool(rng.random() < 0.35)
    plant = _plant(rng, integrating, tau, theta)
    controller = _controller(rng, integrating, tau, theta, tight=cause == "tuning")
    disturbance = _disturbance(rng, cause)
    limits = {"tuning": (-4.0, 4.0), "saturation": (-float(rng.uniform(0.0, 0.7)), 1e6)}.get(cause)
    noise = float(10 ** (rng.uniform(-2.7, -0.7) if cause == "stiction" else rng.uniform(-2.2, 0.1)))
    return LoopSpec(
        plant=plant,
        controller=controller,
        valve=TwoParameterValve(S, J),
        load=disturbance if integrating else Signal(),
        upset=Signal() if integrating else disturbance,
        sp=_set_point(rng, cause),
        noise=Signal(noise_sd=noise, noise_tau_s=float(rng.choice([0.0, 1.0, 3.0]))),
        op_limits=limits or (-1e6, 1e6),
        pv_resolution=_resolution(rng, cause),
        op_resolution=float(10 ** rng.uniform(-2, -1)) if rng.random() < 0.2 else 0.0,
        step_s=1.0 / int(rng.choice([1, 2, 5, 10])),
        settle_s=150.0,
    )


def _plant(rng: np.random.Generator, integrating: bool, tau: float, theta: float) -> Plant:
    if integrating:
        return integrator(1.0 / tau, theta, tau * float(rng.uniform(0.05, 0.5)))
    if rng.random() < 0.5:
        return first_order(1.0, tau, theta)
    return second_order(1.0, 0.6 * tau, float(rng.uniform(1.0, 1.5)), theta)


def _controller(rng: np.random.Generator, integrating: bool, tau: float, theta: float, tight: bool) -> Pid:
    if integrating:
        Kc = float(10 ** rng.uniform(-1.0, 0.2)) * tau / (theta + 0.5 * tau)
        Ti_s = (theta + tau) * float(10 ** rng.uniform(0.0, 1.6))
    else:
        Kc = float(10 ** rng.uniform(-1.0, 0.3)) * min(tau / theta, 3.0)
        Ti_s = (tau + 0.5 * theta) * float(10 ** rng.uniform(-0.8, 0.6))
    if rng.random() < 0.1:
        Ti_s *= 10.0
    if tight:
        Kc, Ti_s = Kc * float(rng.uniform(1.5, 6.0)), Ti_s * float(rng.uniform(0.2, 1.0))
    return Pid(Kc=Kc, Ti_s=Ti_s)


def _disturbance(rng: np.random.Generator, cause: str) -> Signal:
    size = {"stiction": float(10 ** rng.uniform(-2.0, -0.3)), "quiet": 0.2, "saturation": 0.3, "tuning": 0.5}.get(
        cause, 1.0
    )
    waves: tuple[Wave, ...] = ()
    if cause in ("oscillation", "saturation"):
        size *= float(rng.uniform(0.05, 0.7))
        waves = _waves(rng, float(rng.uniform(1.0, 2.0)))
    elif cause == "stiction" and rng.random() < 0.15:
        waves = _waves(rng, float(rng.uniform(0.1, 0.5)))
    steps: tuple[tuple[float, float], ...] = ()
    if rng.random() < 0.15:
        steps = tuple((float(rng.uniform(0, 1000)), 2.0 * size * float(rng.normal())) for _ in range(3))
    tau_s = float(10 ** rng.uniform(0.3, 2.5))
    return Signal(noise_sd=size, noise_tau_s=tau_s, waves=waves, steps=steps, value=1.0 if cause == "stiction" else 0.0)


def _waves(rng: np.random.Generator, amplitude: float) -> tuple[Wave, ...]:
    period = float(10 ** rng.uniform(0.8, 2.2))
    form = rng.choice(["sine", "triangle", "square"], p=[0.7, 0.2, 0.1])
    main = Wave(amplitude, period, form, float(rng.uniform(0, 6.28)))
    beside = Wave(amplitude * float(rng.uniform(0, 0.6)), period * float(rng.uniform(0.85, 1.2)), "sine", 1.0)
    if rng.random() < 0.3:
        return (main, beside, Wave(0.4 * amplitude, period / 2, "sine", float(rng.uniform(0, 6.28))))
    return (main, beside)


def _set_point(rng: np.random.Generator, cause: str) -> Signal:
    moving = {"set_point": 1.0, "stiction": 0.3, "load": 0.3, "quiet": 0.3}.get(cause, 0.0)
    if rng.random() >= moving:
        return Signal()
    size = float(rng.uniform(0.3, 2.0) if cause == "stiction" else 10 ** rng.uniform(-0.3, 1.2))
    kind = rng.integers(3)
    if kind == 0:
        steps = tuple((float(rng.uniform(0, 1200)), size * float(rng.normal())) for _ in range(int(rng.integers(1, 6))))
        return Signal(steps=steps)
    if kind == 1:
        return Signal(waves=_waves(rng, size))
    return Signal(noise_sd=size, noise_tau_s=float(10 ** rng.uniform(1.0, 2.5)))


def _resolution(rng: np.random.Generator, cause: str) -> float:
    if cause == "quantisation":
        return 0.7 * float(10 ** rng.uniform(-0.3, 0.4))
    return float(10 ** rng.uniform(-2.0, -0.8)) if rng.random() < 0.15 else 0.0
