"""How often explain, given no simulation, names a stem that sticks where one does, and where none does:
`python stems.py [--sticking N] [--healthy N] [--loaded N] [--stepped N] [--levels N] [--sound-levels N]`.

Limit cycles of valves in He's form whose slip is from none to all of S, and loops with a sound valve under waves,
triangles, drifts, squares, tight tuning and two waves at once; then such valves under a load that steps or walks, and
sound ones under one that steps; then levels (an integrating process) under loads that step with valves that stick, and
under steps, squares, walks, waves and triangles with sound ones.
"""

import argparse
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from app.engine.mismatch import Comparison, Explanation, compile_kernels, explain
from app.engine.recording import FloatArray
from app.engine.simulate import LoopSpec, Pid, Plant, Signal, TwoParameterValve, first_order, integrator, simulate_loop

SAMPLES, SHARES = 1440, (0.0, 0.25, 0.5, 0.75, 1.0)
WITHIN = 0.1
SHAPES = {1: 3, 3: 0, 4: 1}  # of what moves a sound level, as `shaken` counts them: a square, a wave, a triangle
ACCUSING = {"valve.stiction", "valve.deadband"}
Sized = tuple[float, float, Comparison]


def loop(valve: TwoParameterValve, controller: Pid, plant: Plant, load: Signal, **other: float) -> LoopSpec:
    return LoopSpec(
        plant=plant,
        controller=controller,
        valve=valve,
        load=load,
        noise=Signal(noise_sd=other["noise"]),
        pv_start=50.0,
        op_start=50.0,
        op_limits=(0.0, 100.0),
    )


def recorded(name: str, spec: LoopSpec, samples: int, ts: float, seed: int) -> Comparison:
    made = simulate_loop(spec, samples * ts, ts, seed)
    return Comparison(name, ts, made.op, made.pv, made.sp)


def started(k: int, rng: np.random.Generator, S: float, ts: float) -> Signal:
    """A load that steps once."""
    return Signal(steps=((0.0, 1.0),))


def loaded(k: int, rng: np.random.Generator, S: float, ts: float) -> Signal:
    """A load that steps three to eight times by up to 1.5 S, or that walks."""
    few = int(rng.integers(3, 9))
    if k % 3 < 2:
        times = np.sort(rng.uniform(0.0, SAMPLES * ts, few))
        return steps_of(times, rng.uniform(-1.5 * S, 1.5 * S, few))
    return steps_of(np.arange(SAMPLES) * ts, 0.02 * S * rng.standard_normal(SAMPLES))


def sticking(count: int, seed: int, load_of: Callable[..., Signal] = started) -> Iterator[Sized]:
    """S, J and the loop, under a load of some kind."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        S, share = float(rng.choice([4, 6, 8, 12])), SHARES[k % len(SHARES)]
        noise, ts, Kc = (float(rng.choice(some)) for some in ([0.05, 0.1, 0.2, 0.4], [2.0, 5.0], [0.6, 1.0, 1.5]))
        load = load_of(k, rng, S, ts)
        spec = loop(TwoParameterValve(S, share * S), Pid(Kc, 20.0, 0.0), first_order(1.0, 20.0, 2.0), load, noise=noise)
        yield S, share * S, recorded(f"sticking {k}", spec, SAMPLES, ts, seed + k)


def stepped(count: int, seed: int) -> Iterator[Comparison]:
    """Loops with a sound valve under a load of few or many steps."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        ts, noise = float(rng.choice([1.0, 2.0, 5.0])), float(rng.choice([0.05, 0.1, 0.2, 0.4]))
        tau, theta = float(rng.choice([10, 20, 40])), float(rng.choice([2, 5, 10]))
        Kc, few = float(rng.choice([0.3, 0.6, 1.0, 1.6])), int(rng.integers(3, 40))
        times, size = np.sort(rng.uniform(0.0, SAMPLES * ts, few)), float(rng.choice([1, 3, 8]))
        load = steps_of(times, rng.uniform(-size, size, few))
        spec = loop(TwoParameterValve(0.0, 0.0), Pid(Kc, tau, 0.0), first_order(1.0, tau, theta), load, noise=noise)
        yield recorded(f"stepped {k}", spec, SAMPLES, ts, seed + k)


def levels(count: int, seed: int) -> Iterator[Sized]:
    """S, J and the loop: a level whose valve sticks, under a load that steps three to eight times by up to S."""
    for k in range(seed, seed + count):
        rng = np.random.default_rng(k)
        S = float(rng.choice([3, 5, 8]))
        J = S * float(rng.choice(SHARES))
        ts, noise, plant, gain = of_level(rng, [2, 5])
        tuned = Pid(float(rng.choice([0.5, 1.0, 2.0])) * 0.02 / gain, float(rng.choice([120, 240, 400])), 0.0)
        few = int(rng.integers(3, 9))
        times = np.sort(rng.uniform(0.0, SAMPLES * ts, few))
        load = steps_of(times, rng.uniform(-S, S, few))
        spec = loop(TwoParameterValve(S, J), tuned, plant, load, noise=noise)
        yield S, J, recorded(f"level {k}", spec, SAMPLES, ts, k)


def sound_levels(count: int, seed: int) -> Iterator[Comparison]:
    """Levels with a sound valve; the remainder of the seed by 5 says what moves them."""
    for k in range(seed, seed + count):
        rng = np.random.default_rng(k)
        ts, noise, plant, gain = of_level(rng, [2, 5, 10])
        tuned = Pid(float(rng.choice([0.25, 0.5, 1.0, 2.0])) * 0.02 / gain, float(rng.choice([120, 240, 400])), 0.0)
        size, period, at = float(rng.choice([2, 5, 8])), float(rng.uniform(100, 600)), np.arange(SAMPLES) * ts
        if k % 5 == 0:
            few = int(rng.integers(3, 9))
            load = steps_of(np.sort(rng.uniform(0.0, SAMPLES * ts, few)), rng.uniform(-size, size, few))
        else:
            walk = np.cumsum(0.02 * size * rng.standard_normal(SAMPLES)) if k % 5 == 2 else None
            moved = np.diff(shaken(SHAPES[k % 5], size, period, at, rng) if walk is None else walk, prepend=0.0)
            load = Signal(steps=tuple((float(t), float(m)) for t, m in zip(at, moved, strict=True) if m != 0.0))
        spec = loop(TwoParameterValve(0.0, 0.0), tuned, plant, load, noise=noise)
        yield recorded(f"sound level {k}", spec, SAMPLES, ts, k)


def of_level(rng: np.random.Generator, dead_times: list[int]) -> tuple[float, float, Plant, float]:
    """Sampling interval, noise, process and its gain."""
    ts, noise = float(rng.choice([2.0, 5.0])), float(rng.choice([0.05, 0.1, 0.2]))
    gain = float(rng.choice([0.002, 0.005, 0.01]))
    return ts, noise, integrator(gain, float(rng.choice(dead_times))), gain


def steps_of(times: FloatArray, moves: FloatArray) -> Signal:
    """A load that moves at these times, after a first step that starts the loop."""
    return Signal(steps=((0.0, 1.0), *zip(times.tolist(), moves.tolist(), strict=True)))


def healthy(seed: int) -> Comparison:
    """A loop whose valve is sound; the remainder of the seed by 6 says what moves it."""
    rng = np.random.default_rng(seed)
    ts, samples = float(rng.choice([1.0, 2.0, 5.0])), int(rng.choice([900, 1440, 2000]))
    tau, theta = float(rng.choice([10, 20, 40])), float(rng.choice([2, 5, 10]))
    Kc, noise = float(rng.choice([0.3, 0.6, 1.0, 1.6])), float(rng.choice([0.05, 0.1, 0.2, 0.4]))
    period, size = float(rng.uniform(60, 400)), float(rng.choice([1, 2, 4]))
    at = np.arange(samples) * ts
    moved = np.diff(shaken(seed % 6, size, period, at, rng), prepend=0.0)
    load = Signal(
        steps=tuple((float(t), float(m)) for t, m in zip(at, moved, strict=True) if m != 0.0) or ((0.0, 1.0),)
    )
    tuned = Pid(2.0 * Kc if seed % 6 == 4 else Kc, tau, 0.0)
    spec = loop(TwoParameterValve(0.0, 0.0), tuned, first_order(1.0, tau, theta), load, noise=noise)
    return recorded(f"healthy {seed}", spec, samples, ts, seed)


def shaken(kind: int, size: float, period: float, at: FloatArray, rng: np.random.Generator) -> FloatArray:
    """What comes from outside (N,): a wave, a triangle, a drift, a square, nothing, two waves of which one swells."""
    turn = 2.0 * np.pi * at / period
    if kind == 1:
        return size * (4.0 * np.abs((at / period) % 1.0 - 0.5) - 1.0)
    if kind == 2:
        return np.cumsum(0.15 * rng.standard_normal(len(at)))
    wave = np.sin(turn)
    two = wave * (1.0 + 0.4 * np.sin(turn / 7.0)) + 0.5 * np.sin(2.0 * turn)
    return size * {0: wave, 3: np.sign(wave), 4: np.zeros(len(at))}.get(kind, two)


def right(said: Explanation, S: float, J: float, beside: tuple[str, ...] = ()) -> bool:
    """Whether the valve is named, its size within a tenth, and nothing but what acts `beside` it; a slip of nearly
    nothing is a deadband.
    """
    named = [effect for effect in said.effects if not effect.code.startswith(beside)]
    if len(named) != 1 or named[0].code not in ACCUSING:
        return False
    size = [p.value for p in named[0].parameters]
    slip = size[1] if named[0].code == "valve.stiction" else 0.0
    kind = slip < WITHIN * S if J == 0.0 else named[0].code == "valve.stiction"
    return kind and abs(size[0] / S - 1.0) < WITHIN


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--sticking", type=int, default=24)
    options.add_argument("--healthy", type=int, default=120)
    options.add_argument("--loaded", type=int, default=40)
    options.add_argument("--stepped", type=int, default=60)
    options.add_argument("--levels", type=int, default=40)
    options.add_argument("--sound-levels", type=int, default=80)
    options.add_argument("--seed", type=int, default=100)
    given = options.parse_args()
    compile_kernels()
    shaken_by = range(7 * given.seed, 7 * given.seed + given.healthy)
    with ProcessPoolExecutor(2) as pool:
        known = list(sticking(given.sticking, given.seed))
        named = [right(*said) for said in told_of(known, pool)]
        print(f"sticking: {sum(named)} of {len(named)} named alone and sized within {WITHIN:.0%}")
        known = list(sticking(given.loaded, 4 * given.seed, loaded))
        named = [right(*said, ("disturbance.",)) for said in told_of(known, pool)]
        print(f"under a load: {counted(named, known)}")
        accused(list(pool.map(explain, map(healthy, shaken_by))))
        accused(list(pool.map(explain, stepped(given.stepped, 9 * given.seed))))
        known = list(levels(given.levels, 50 * given.seed))
        named = [right(*said, ("disturbance.", "sensor.drift")) for said in told_of(known, pool)]
        print(f"levels under a load: {counted(named, known)}")
        accused(list(pool.map(explain, sound_levels(given.sound_levels, 90 * given.seed))))


def counted(named: list[bool], known: list[Sized]) -> str:
    half = [right for right, (S, J, _) in zip(named, known, strict=True) if J >= 0.5 * S]
    return f"{sum(named)} of {len(named)}, {sum(half)} of {len(half)} where J is half of S or more"


def told_of(known: list[Sized], pool: ProcessPoolExecutor) -> list[tuple[Explanation, float, float]]:
    told = pool.map(explain, [comparison for _, _, comparison in known])
    return [(said, S, J) for said, (S, J, _) in zip(told, known, strict=True)]


def accused(sound: list[Explanation]) -> None:
    wrongly = [said for said in sound if ACCUSING & {effect.code for effect in said.effects}]
    print(f"healthy: {len(wrongly)} of {len(sound)} are called a valve that sticks")
    for said in wrongly:
        print(f"  {said.name}: {', '.join(effect.code for effect in said.effects)}")


if __name__ == "__main__":
    main()
