"""`python -m app.lab.testbench.slow_control`: sluggish PI control under a load that wanders, few slow swings a record.

All but the valve is linear: a controller that integrates slowly makes of such a load what looks like triangles and
corners, by chance. Prints how often the audit accuses valves, healthy and sticking. None of these loops is in any fit.
"""

import sys
from collections.abc import Iterator
from typing import Literal

import numpy as np

from app.engine.recording import FloatArray, Recording
from app.lab.testbench.seeded import accused_and_cleared, print_report, tallied
from app.lab.testbench.wiring import Lag, Level, Pi, Valve, Wandering

Kind = Literal["flow", "filtered flow", "level"]
KINDS: tuple[Kind, ...] = ("flow", "filtered flow", "level")
INTERVAL_S, SETTLING = 10.0, 500
SAMPLES = (600, 1900)  # bounds
FILTER_S = 100.0


def record(kind: Kind, seed: int, sticks: bool) -> Recording:
    """One loop. Where the valve sticks, by 1 to 4 % of OP's span, its load is a seventh of what it is elsewhere."""
    rng = np.random.default_rng([seed, KINDS.index(kind), int(sticks)])
    samples = int(rng.integers(*SAMPLES))
    rows: FloatArray = np.array(list(_scans(kind, rng, sticks, samples)))[SETTLING:]
    time_s: FloatArray = INTERVAL_S * np.arange(len(rows), dtype=np.float64)
    name = f"{kind} {seed}{' sticking' * sticks}"
    return Recording(name, time_s, rows[:, 0].copy(), rows[:, 1].copy(), np.full(len(rows), 50.0))


def _scans(kind: Kind, rng: np.random.Generator, sticks: bool, samples: int) -> Iterator[tuple[float, float]]:
    """PV and OP, scan by scan."""
    tau_s, K = float(rng.uniform(100.0, 400.0)), float(rng.uniform(0.5, 2.0))
    Ti_s = tau_s * float(rng.uniform(0.6, 3.0))
    delay = 1 + int(rng.uniform(1.0, 8.0))
    S = float(rng.uniform(1.0, 4.0)) if sticks else 0.0
    valve, load = Valve(50.0, S, S), Wandering(rng, 0.15 if sticks else 1.0, float(rng.uniform(50.0, 1200.0)))
    plant: Lag | Level = Level(tau_s / K) if kind == "level" else Lag(K, tau_s, delay)
    gain = float(rng.uniform(0.05, 0.24)) / K * tau_s / (delay * INTERVAL_S + 30.0)
    gain = float(rng.uniform(0.3, 1.2)) * tau_s / (K * Ti_s) if kind == "level" else gain
    pi, noise = Pi(gain, Ti_s, 50.0), float(rng.uniform(0.01, 0.12)) * (0.3 if sticks else 1.0)
    forgets = float(np.exp(-INTERVAL_S / FILTER_S)) if kind == "filtered flow" else 0.0
    position = deviation = 0.0
    for _ in range(SETTLING + samples):
        measured = plant.after(position + 1.5 * load.after(INTERVAL_S), INTERVAL_S) + noise * rng.standard_normal()
        deviation += (1.0 - forgets) * (measured - deviation)
        op = pi.output(-deviation, INTERVAL_S)
        position = valve.to(op) - 50.0
        yield 50.0 + deviation, op


def report(seeds: range) -> Iterator[str]:
    yield "| loop | healthy: accused | reliably | cleared reliably | sticking: accused | reliably | cleared reliably |"
    yield "|---|---|---|---|---|---|---|"
    for kind in KINDS:
        said = [tallied(record(kind, seed, sticks) for seed in seeds) for sticks in (False, True)]
        cells = [accused_and_cleared(each) for each in said]
        yield f"| {kind} ({len(seeds)}, {len(seeds)}) | {' | '.join(cells)} |"


def main(arguments: list[str] | None = None) -> int:
    return print_report("slow_control", __doc__, report, arguments, many=100)


if __name__ == "__main__":
    sys.exit(main())
