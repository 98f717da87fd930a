"""Healthy valves in loops that something else spoils, each with the cause that a good audit would name."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from app.engine.recording import FloatArray, Recording
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, integrator, simulate_loop
from app.errors import DataError
from app.lab.testbench.building import build
from app.lab.testbench.case import Cause, ordinary

_FROM_CASES: dict[str, Cause] = {
    "stiction": "stiction",
    "tight_tuning": "tight",
    "sine_from_outside": "sine",
    "wandering_load": "coloured",
    "load_steps": "steps",
    "set_point_following": "set_point",
    "saturated_op": "saturated",
    "quantised_sensor": "quantised",
    "quiet": "quiet",
}
_SAMPLES = 1200


@dataclass(frozen=True, eq=False)
class Spoiled:
    """A recording and what spoils it; `cause` is "stiction" for a sticky valve."""

    recording: Recording
    cause: str


def spoiled_loops(each: int, seed: int = 1) -> Iterator[Spoiled]:
    """`each` loops of every cause; the same seed gives the same loops."""
    for k, (cause, case_cause) in enumerate(_FROM_CASES.items()):
        found, repeat = 0, 0
        while found < each:
            case = ordinary(np.random.default_rng([seed, k, repeat]), case_cause)
            repeat += 1
            try:
                built = build(case)
            except DataError:
                continue
            if case.sticky and not built.exercised:
                continue
            found += 1
            yield Spoiled(built.recording, cause)
    for k, (cause, make) in enumerate(_OWN.items()):
        for repeat in range(each):
            yield Spoiled(make(np.random.default_rng([seed, 100 + k, repeat])), cause)


def _calm(rng: np.random.Generator, tightness: float) -> LoopSpec:
    """A lag of 10 s with 2 to 8 s dead time under PI; tightness 1 is near the limit of stability."""
    theta_s = float(rng.uniform(2.0, 8.0))
    Kc = tightness * (1.5 * 10.0 / theta_s + 0.5)
    return LoopSpec(
        plant=first_order(1.0, 10.0, theta_s),
        controller=Pid(Kc, 8.0 + theta_s),
        noise=Signal(noise_sd=float(rng.uniform(0.02, 0.15))),
        load=Signal(noise_sd=1.0, noise_tau_s=float(rng.uniform(10.0, 60.0))),
        pv_start=50.0,
        op_start=50.0,
        step_s=0.25,
        settle_s=300.0,
    )


def _record(spec: LoopSpec, rng: np.random.Generator) -> Recording:
    return simulate_loop(spec, float(_SAMPLES), 1.0, int(rng.integers(2**31))).recording("spoiled")


def _some_steps(rng: np.random.Generator, size: float, count: int) -> tuple[tuple[float, float], ...]:
    """Steps between random levels, far enough apart for a loop to settle."""
    levels = np.concatenate(([0.0], size * rng.standard_normal(count)))
    times = np.linspace(0.05, 0.9, count) * _SAMPLES + rng.uniform(-15.0, 15.0, count)
    return tuple(zip(times.tolist(), np.diff(levels).tolist(), strict=True))


def _aggressive(rng: np.random.Generator) -> Recording:
    spec = _calm(rng, float(rng.uniform(0.75, 0.92)))
    if rng.random() < 0.5:
        spec = replace(spec, load=replace(spec.load, noise_sd=0.1, steps=_some_steps(rng, 3.0, 12)))
    return _record(spec, rng)


def _sluggish(rng: np.random.Generator) -> Recording:
    spec = _calm(rng, float(rng.uniform(0.02, 0.06)))
    return _record(replace(spec, load=Signal(noise_sd=0.1, noise_tau_s=20.0, steps=_some_steps(rng, 4.0, 6))), rng)


def _backlash(rng: np.random.Generator) -> Recording:
    """Pure deadband under PI on a level cycles; the load keeps it moving."""
    spec = replace(
        _calm(rng, 0.3),
        plant=integrator(0.1, float(rng.uniform(1.0, 4.0)), 3.0),
        controller=Pid(float(rng.uniform(0.4, 1.0)), float(rng.uniform(15.0, 40.0))),
        valve=TwoParameterValve(float(rng.uniform(3.0, 10.0)), 0.0),
        load=Signal(value=3.0, noise_sd=0.3, noise_tau_s=30.0),
    )
    return _record(spec, rng)


def _spikes(rng: np.random.Generator) -> Recording:
    spec = _calm(rng, float(rng.uniform(0.1, 0.4)))
    times = np.sort(rng.choice(_SAMPLES - 10, int(rng.integers(8, 40)), replace=False) + 2)
    sizes = rng.choice([-1.0, 1.0], len(times)) * rng.uniform(5.0, 12.0, len(times))
    steps = [(float(t), float(size)) for t, size in zip(times, sizes, strict=True)]
    steps += [(t + 1.0, -size) for t, size in steps]
    return _record(replace(spec, noise=replace(spec.noise, steps=tuple(sorted(steps)))), rng)


def _sticking_sensor(rng: np.random.Generator) -> Recording:
    """The transmitter holds until the truth is a band away from what it shows; the controller believes it."""
    band, delay, Kc = float(rng.uniform(0.5, 2.0)), int(rng.integers(1, 5)), float(rng.uniform(0.3, 0.9))
    Ti = float(rng.uniform(8.0, 20.0))
    load = _walk(rng, 0.2 * band)
    op, pv = np.zeros(_SAMPLES), np.zeros(_SAMPLES)
    truth = shown = integral = 0.0
    keep = float(np.exp(-1.0 / 10.0))
    for t in range(_SAMPLES):
        truth = keep * truth + (1.0 - keep) * ((op[t - delay] if t >= delay else 0.0) + load[t])
        if abs(truth - shown) > band:
            shown = truth + 0.02 * float(rng.standard_normal())
        pv[t] = shown
        integral -= Kc * (shown - 0.3) / Ti
        op[t] = integral - Kc * shown
    return Recording("spoiled", np.arange(_SAMPLES, dtype=float), 50.0 + pv, 50.0 + op, np.full(_SAMPLES, 50.3))


def _walk(rng: np.random.Generator, size: float) -> FloatArray:
    """A load that wanders about zero with a standard deviation of some ten times `size`."""
    keep, load = 0.995, np.zeros(_SAMPLES)
    for t in range(1, _SAMPLES):
        load[t] = keep * load[t - 1] + size * float(rng.standard_normal())
    return load


_OWN = {
    "aggressive_controller": _aggressive,
    "sluggish_controller": _sluggish,
    "backlash": _backlash,
    "sensor_spikes": _spikes,
    "sensor_sticking": _sticking_sensor,
}
