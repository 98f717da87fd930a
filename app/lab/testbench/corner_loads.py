"""`python -m app.lab.testbench.corner_loads`: healthy valves under loads that come in corners from elsewhere.

Triangles, saw teeth, a load that is switched or comes through a vessel, a pump that runs between two levels upstream,
a second pump on the level itself; beside them valves that stick, alone, under a load that wanders, and under corners of
up to half of S. Prints how often the audit accuses and clears which, reliably. None of these loops is in any fit.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from app.engine.recording import FloatArray, Recording
from app.lab.testbench.seeded import accused_and_cleared, print_report, tallied
from app.lab.testbench.wiring import Lag, Level, Pi, Valve, Wandering

INTERVAL_S, SETTLING = 5.0, 500
SAMPLES = (700, 3000)  # bounds


@dataclass(frozen=True)
class Course:
    """How a load from outside goes: about so long a cycle, s, up to so far from zero, for so many scans."""

    rng: np.random.Generator
    period_s: float
    size: float
    scans: int

    def uneven(self, spread: float) -> float:
        return float(np.exp(spread * self.rng.standard_normal()))


def _ramps(course: Course, rising: float) -> FloatArray:
    """Straight lines between corners, of which the time, the height or both differ from cycle to cycle."""
    spread, tall = float(course.rng.choice([0.03, 0.08, 0.15, 0.3])), float(course.rng.choice([0.0, 1.0]))
    times, heights = [0.0], [-course.size]
    while times[-1] < course.scans * INTERVAL_S:
        for share, way in ((rising, 1.0), (1.0 - rising, -1.0)):
            times.append(times[-1] + max(share * course.period_s * course.uneven(spread), 0.5 * INTERVAL_S))
            heights.append(way * course.size * course.uneven(tall * spread))
    return np.interp(INTERVAL_S * np.arange(course.scans), times, heights)


def triangles(course: Course) -> FloatArray:
    return _ramps(course, float(course.rng.uniform(0.35, 0.65)))


def saw_teeth(course: Course) -> FloatArray:
    return _ramps(course, 0.5 + float(course.rng.choice([-1.0, 1.0]) * course.rng.uniform(0.38, 0.48)))


def switched(course: Course) -> FloatArray:
    """On and off, for times that differ."""
    on, spread = float(course.rng.uniform(0.25, 0.75)), float(course.rng.choice([0.03, 0.08, 0.15, 0.3]))
    pieces: list[FloatArray] = []
    while sum(map(len, pieces)) < course.scans:
        for share, way in ((on, 1.0), (1.0 - on, -1.0)):
            scans = max(1, round(share * course.period_s * course.uneven(spread) / INTERVAL_S))
            pieces.append(np.full(scans, way * course.size))
    return np.concatenate(pieces)[: course.scans]


def through_a_vessel(course: Course) -> FloatArray:
    """The same, behind a first order of a twentieth to a half of a cycle."""
    lag = Lag(1.0, course.period_s * float(course.rng.uniform(0.05, 0.5)))
    return np.array([lag.after(float(u), INTERVAL_S) for u in switched(course)])


def pump_upstream(course: Course) -> FloatArray:
    """The level of a vessel that a pump empties between two heights, while what comes in wanders."""
    inflow = Wandering(course.rng, 0.12, course.period_s * float(course.rng.uniform(0.3, 3.0)))
    mean, level, runs = float(course.rng.uniform(0.3, 0.7)), 0.0, 0.0
    levels = np.empty(course.scans)
    for k in range(course.scans):
        level += (mean + inflow.after(INTERVAL_S) - runs) * 4.0 * INTERVAL_S / course.period_s
        runs = 1.0 if level > 1.0 else 0.0 if level < -1.0 else runs
        levels[k] = level
    return course.size * levels


Load = Callable[[Course], FloatArray]
LOADS: dict[str, Load] = {
    "triangles": triangles, "saw teeth": saw_teeth, "switched": switched, "through a vessel": through_a_vessel,
    "pump upstream": pump_upstream,
}  # fmt: skip
OWN_PUMP = "pump on the level"
HEALTHY = (*LOADS, OWN_PUMP)
STICKING = ("alone", "load that wanders", "corners")


@dataclass
class _Pump:
    """Takes out flow, less what comes in on average, between two heights of the level that it is on."""

    band: float
    flow: float
    mean: float
    _runs: bool = False

    def load(self, level: float) -> float:
        self._runs = level > self.band or (self._runs and level >= -self.band)
        return self.mean - (self.flow if self._runs else 0.0)


@dataclass(frozen=True)
class _Loop:
    """settles_s: about how long the loop takes to bring PV back."""

    plant: Lag | Level
    pi: Pi
    settles_s: float


def _loop(rng: np.random.Generator, is_level: bool) -> _Loop:
    if is_level:
        hold_s, Kc = float(rng.uniform(200.0, 800.0)), float(rng.uniform(1.0, 4.0))
        return _Loop(Level(hold_s), Pi(Kc, float(rng.uniform(1.0, 8.0)) * hold_s / Kc, 50.0), hold_s / Kc)
    quick, K = rng.random() < 1.0 / 3.0, float(rng.uniform(0.6, 1.6))
    tau_s = float(rng.uniform(3.0, 8.0) if quick else rng.uniform(15.0, 80.0))
    loop_gain = float(rng.uniform(0.1, 0.5) if quick else rng.uniform(0.25, 1.0))
    Ti_s = float(rng.uniform(5.0, 25.0)) if quick else tau_s * float(rng.uniform(0.6, 2.0))
    delay = 1 if quick else 1 + round(float(rng.uniform(0.1, 0.4)) * tau_s / INTERVAL_S)
    return _Loop(Lag(K, tau_s, delay), Pi(loop_gain / K, Ti_s, 50.0), Ti_s / loop_gain)


def record(kind: str, seed: int, sticks: bool) -> Recording:
    """One loop of a kind, of HEALTHY or of STICKING where its valve sticks, by 2 to 8 % of OP's span."""
    rng = np.random.default_rng([seed, int(sticks), (STICKING if sticks else HEALTHY).index(kind)])
    scans = SETTLING + int(rng.integers(*SAMPLES))
    rows: FloatArray = np.round(np.array(list(_scans(kind, rng, scans, sticks)))[SETTLING:], 2)
    time_s: FloatArray = INTERVAL_S * np.arange(len(rows), dtype=np.float64)
    name = f"{kind} {seed}{' sticking' * sticks}"
    return Recording(name, time_s, rows[:, 0].copy(), rows[:, 1].copy(), np.full(len(rows), 50.0))


def _scans(kind: str, rng: np.random.Generator, scans: int, sticks: bool) -> Iterator[tuple[float, float]]:
    """PV and OP, scan by scan; PV as measured, in half of the loops through a filter."""
    loop = _loop(rng, is_level=kind == OWN_PUMP or rng.random() < 0.25)
    S = float(rng.uniform(2.0, 8.0)) if sticks else 0.0
    valve = Valve(50.0, S, S * float(rng.uniform(0.15, 1.0)))
    outside = _outside(kind, rng, loop.settles_s, scans, S)
    wanders = S * float(rng.uniform(0.1, 0.4)) if kind == "load that wanders" else float(rng.uniform(0.05, 0.6))
    load = Wandering(rng, 0.1 if kind in ("alone", "corners") else wanders, loop.settles_s * float(rng.uniform(1, 10)))
    flow = float(rng.uniform(8.0, 25.0)) if kind == OWN_PUMP else 0.0
    pump = _Pump(float(rng.uniform(1.5, 5.0)), flow, flow * float(rng.uniform(0.3, 0.7)))
    noise, forgets = float(10.0 ** rng.uniform(-1.5, -0.5)), float(rng.choice([0.0, 0.0, 0.5, 0.8]))
    position, level, deviation = 2.5 if sticks else 0.0, 0.0, 0.0
    for k in range(scans):
        level = loop.plant.after(position + outside[k] + load.after(INTERVAL_S) + pump.load(level), INTERVAL_S)
        deviation += (1.0 - forgets) * (level + noise * float(rng.standard_normal()) - deviation)
        op = loop.pi.output(-deviation, INTERVAL_S)
        position = valve.to(op) - 50.0 + (2.5 if sticks else 0.0)
        yield 50.0 + deviation, op


def _outside(kind: str, rng: np.random.Generator, settles_s: float, scans: int, S: float) -> FloatArray:
    """A load in corners, slower than the loop is, with ten cycles or more in a record."""
    names = [name for name in LOADS if name != "switched"]
    name, size = (kind, float(rng.uniform(2.0, 8.0))) if kind in LOADS else (str(rng.choice(names)), 0.0)
    size = S * float(rng.uniform(0.1, 0.5)) if kind == "corners" else size
    period_s = settles_s * float(10.0 ** rng.uniform(0.5, 1.4))
    return LOADS[name](Course(rng, float(np.clip(period_s, 12 * INTERVAL_S, scans * INTERVAL_S / 10)), size, scans))


def report(seeds: range) -> Iterator[str]:
    yield "| valve | load | loops | accused | reliably | cleared reliably |"
    yield "|---|---|---|---|---|---|"
    for sticks, kinds in ((False, HEALTHY), (True, STICKING)):
        for kind in kinds:
            said = tallied(record(kind, seed, sticks) for seed in seeds)
            yield f"| {'sticks' if sticks else 'healthy'} | {kind} | {len(seeds)} | {accused_and_cleared(said)} |"


def main(arguments: list[str] | None = None) -> int:
    return print_report("corner_loads", __doc__, report, arguments, many=60)


if __name__ == "__main__":
    sys.exit(main())
