"""Long records whose valve sticks for a part of the time only."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.recording import Recording
from app.engine.simulate import LinearValve, SimulatedLoop, simulate_loop
from app.lab.testbench.building import build
from app.lab.testbench.case import ordinary


@dataclass(frozen=True, eq=False)
class Spell:
    """A recording and the stretch in which its valve sticks, s from its start; None: never."""

    recording: Recording
    start_s: float | None
    end_s: float | None
    kind: str


def spell(seed: int, samples: int = 12_000, share: float = 0.2, first: float | None = None) -> Spell:
    """A loop of the bench whose valve is free but for `share` of the record, from the share `first` on (None: random).

    The three parts are simulated one after the other: same plant, tuning, noise and load, another valve.
    """
    rng = np.random.default_rng([seed, 17])
    first = float(rng.uniform(0.1, 0.9 - share)) if first is None else first
    loop = _cycling(rng)
    free = replace(loop.spec, valve=LinearValve(), load=replace(loop.spec.load, value=0.0))
    edges = [0, round(first * samples), round((first + share) * samples), samples]
    interval_s = loop.sampling_interval_s
    parts = [
        simulate_loop(spec, (b - a) * interval_s, interval_s, seed + k)
        for k, (spec, a, b) in enumerate(zip((free, loop.spec, free), edges, edges[1:], strict=False))
        if b - a >= 2
    ]
    pv, op, sp = (np.concatenate([getattr(part, name) for part in parts]) for name in ("pv", "op", "sp"))
    recording = Recording("spell", np.arange(len(pv), dtype=np.float64) * interval_s, pv, op, sp)
    return Spell(recording, edges[1] * interval_s, edges[2] * interval_s, "spell")


def _cycling(rng: np.random.Generator) -> SimulatedLoop:
    """An ordinary sticky loop of the bench that does cycle."""
    while True:
        case = replace(ordinary(rng, "stiction"), points_per_cycle=float(rng.uniform(25.0, 60.0)))
        built = build(case)
        if built.exercised:
            return built.loop
