"""How effects that the library does not have are put into a loop, and how an answer to one is judged."""

from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from tests.proof.concealing import Windows, reach
from tests.proof.generator import LEAST_ENERGY, Loop
from tests.proof.plants import Process
from tests.proof.strange import (
    Adapting,
    Analyser,
    DelayByFlow,
    Igniting,
    LagByDirection,
    Ratchet,
    RelayInside,
    Resonant,
    SpeedByDirection,
    SpeedByLevel,
    SpeedReading,
    WindingSlave,
)

# Names that the library has got since.
RIGHT = {
    "outside.analyser": ("sensor.sample_hold",),
    "outside.resonant": ("process.resonance",),
    "outside.underdamped": ("process.resonance",),
}
SURE, UNSURE, CLEARLY_SEEN = 0.9, 0.6, 200.0
# Names that say what is there, though not the whole of it.
PARTLY = {
    "outside.fouling": ("process.gain_drift",),
    "outside.winding_slave": ("valve.saturation",),
}


def of_kind(kind: type[Process], process: Process, **values: float) -> Process:
    """The same process with physics of its own."""
    return kind(process.gain, process.taus, process.dead_time, process.integrating, process.ts, **values)


def either(rng: Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def sensor_lag_by_direction(loop: Loop, rng: Generator, _: bool) -> Windows:
    slow, quick = loop.ts * loop.speed * rng.uniform(0.4, 1.0), loop.ts * loop.speed * rng.uniform(0.02, 0.12)
    up, down = (slow, quick) if rng.random() < 0.5 else (quick, slow)
    loop.sensor = LagByDirection(float(up), float(down), loop.ts)
    return ()


def speed_by_direction(loop: Loop, rng: Generator, _: bool) -> Windows:
    apart = float(np.exp(0.5 * either(rng) * np.log(rng.uniform(1.8, 4.0))))
    loop.process = of_kind(SpeedByDirection, loop.process, up=apart, down=1.0 / apart)
    return ()


def analyser(loop: Loop, rng: Generator, _: bool) -> Windows:
    loop.sensor = Analyser(max(int(loop.speed * rng.uniform(0.25, 0.8)), 3))
    return ()


def speed_by_level(loop: Loop, rng: Generator, _: bool) -> Windows:
    loop.process = of_kind(SpeedByLevel, loop.process, sensitivity=either(rng) * float(rng.uniform(0.08, 0.18)))
    return ()


def relay(loop: Loop, rng: Generator, _: bool) -> Windows:
    middle, half = float(rng.uniform(-3.0, 3.0)), float(rng.uniform(0.5, 1.8))
    size = float(rng.uniform(1.0, 3.5))
    loop.process = of_kind(RelayInside, loop.process, size=size, on_above=middle + half, off_below=middle - half)
    return ()


def ratchet(loop: Loop, rng: Generator, _: bool) -> Windows:
    apart = either(rng) * float(rng.uniform(0.25, 0.6))
    loop.valve = Ratchet(1.0 + apart, 1.0 - apart, 1.0 / (loop.speed * float(rng.uniform(0.7, 3.0))))
    return ()


def delay_by_flow(loop: Loop, rng: Generator, _: bool) -> Windows:
    sensitivity = float(rng.uniform(1.0, 2.5)) / reach(loop)
    loop.process = of_kind(DelayByFlow, loop.process, sensitivity=sensitivity, filling=loop.process.dead_time)
    return ()


def fouling(loop: Loop, rng: Generator, _: bool) -> Windows:
    period = loop.n / float(rng.uniform(3.0, 8.0))
    saw = ((np.arange(loop.n) + rng.uniform(0.0, period)) % period) / period
    loop.gain_profile = 1.0 - float(rng.uniform(0.35, 0.7)) * saw
    return ()


def resonant(loop: Loop, rng: Generator, _: bool) -> Windows:
    natural_s = loop.process.taus[0] * float(rng.uniform(0.3, 0.6))
    loop.process = of_kind(Resonant, loop.process, damping=float(rng.uniform(0.2, 0.45)), natural_s=natural_s)
    return ()


def underdamped(loop: Loop, rng: Generator, _: bool) -> Windows:
    """Two lags that swing: the engineer's have the right natural frequency, and a damping of 1 and more."""
    natural_s, damping = float(np.sqrt(np.prod(loop.process.taus))), float(rng.uniform(0.15, 0.6))
    loop.process = of_kind(Resonant, loop.process, damping=damping, natural_s=natural_s)
    loop.process.taus, loop.process.states = (natural_s,), [0.0]
    return ()


def igniting(loop: Loop, rng: Generator, _: bool) -> Windows:
    width = float(rng.uniform(1.0, 2.5))
    loop.process = of_kind(Igniting, loop.process, heat=width * float(rng.uniform(0.9, 1.5)), width=width)
    return ()


def winding_slave(loop: Loop, rng: Generator, _: bool) -> Windows:
    limit = reach(loop) * float(rng.uniform(0.1, 0.5))
    loop.valve = WindingSlave(0.5, 1.0 / (0.3 * loop.speed), limit, 0.05 * loop.speed)
    return ()


def speed_reading(loop: Loop, rng: Generator, _: bool) -> Windows:
    share = either(rng) * float(rng.uniform(0.06, 0.3))
    loop.sensor = SpeedReading(share, loop.ts, loop.ts * loop.speed * float(rng.uniform(0.3, 1.0)))
    return ()


def adapting(loop: Loop, rng: Generator, _: bool) -> Windows:
    share = either(rng) * float(rng.uniform(0.5, 1.2)) / reach(loop)
    loop.process = of_kind(Adapting, loop.process, share=share, memory_s=loop.ts * loop.speed * rng.uniform(1.0, 4.0))
    return ()


OUTSIDE: dict[str, Callable[[Loop, Generator, bool], Windows]] = {
    "outside.sensor_lag_by_direction": sensor_lag_by_direction,
    "outside.speed_by_direction": speed_by_direction,
    "outside.analyser": analyser,
    "outside.speed_by_level": speed_by_level,
    "outside.relay": relay,
    "outside.ratchet": ratchet,
    "outside.delay_by_flow": delay_by_flow,
    "outside.fouling": fouling,
    "outside.resonant": resonant,
    "outside.igniting": igniting,
    "outside.winding_slave": winding_slave,
    "outside.speed_reading": speed_reading,
    "outside.adapting": adapting,
    "outside.underdamped": underdamped,
}
NEED_ONE_LAG = (
    "outside.speed_by_direction", "outside.speed_by_level", "outside.resonant", "outside.igniting",
)  # fmt: skip
NEED_TWO_LAGS = ("outside.underdamped",)
# Those that the test of adequacy was made with; the next were kept aside for it, the last has come since.
DEVELOPED, KEPT_ASIDE, SINCE = tuple(OUTSIDE)[:6], tuple(OUTSIDE)[6:13], tuple(OUTSIDE)[13:]
SETS = {
    "outside": DEVELOPED + KEPT_ASIDE,
    "outside-developed": DEVELOPED,
    "outside-aside": KEPT_ASIDE,
    "outside-since": SINCE,
}


def planned_outside(seed: int, count: int, effects: tuple[str, ...]) -> list[tuple[int, tuple[str, ...]]]:
    """Seed and effect of `count` cases, every effect in turn."""
    return [(seed * 100_000 + k, (effects[k % len(effects)],)) for k in range(count)]


def kind_of_answer(line: dict) -> str:
    """What a judged line says of an effect outside the library, in one word or two."""
    if not line["said"]:
        return str(line["verdict"])
    first = line["said"][0][0]
    if first == "unnamed":
        return "unnamed first"
    if first in RIGHT.get(line["true"][0], ()):
        return "named right" if len(line["said"]) == 1 else "named right, and another"
    if first in PARTLY.get(line["true"][0], ()):
        return "named in part"
    probability = line["probability"]
    if probability >= SURE:
        return f"wrong name, p >= {SURE}"
    return f"wrong name, p < {UNSURE}" if probability < UNSURE else "wrong name, p between"


def outside_summary(lines: list[dict]) -> str:
    """Answers to effects outside the library: all that can be seen, those that are clearly seen, and by kind."""
    seen = [x for x in lines if x["energy"] >= LEAST_ENERGY]
    said = []
    for label, least in (("seen", LEAST_ENERGY), ("clearly seen", CLEARLY_SEEN)):
        answers = Counter(kind_of_answer(x) for x in seen if x["energy"] >= least)
        counted = ", ".join(f"{answer} {n}" for answer, n in answers.most_common())
        said.append(f"outside the library, {label} (energy {least:g} or more), {answers.total()}: {counted}")
    for effect in sorted({x["true"][0] for x in seen}):
        answers = Counter(
            f"{kind_of_answer(x)} ({x['said'][0][0]})" if x["said"] else kind_of_answer(x)
            for x in seen if x["true"][0] == effect
        )  # fmt: skip
        said.append(f"  {effect}: " + ", ".join(f"{answer} {n}" for answer, n in answers.most_common()))
    return "\n".join(said)
