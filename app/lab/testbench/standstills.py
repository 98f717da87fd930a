"""`python -m app.lab.testbench.standstills`: what stands at the end of a record of 83 hours, and what only looks so.

Transmitters that froze and stems that stuck so many hours before the end, and loops that have their reasons: in manual,
shut down, coarse, compressed, at a limit, upset, following a set point that moved just now, mended. Prints of how many
loops of each kind is said that PV does not answer OP, by how much the hour that is named is off, and of how many it is
asked why OP stands at its limit.
"""

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from app.engine.causality.stuck_stem import stuck_stem
from app.engine.fitness import assess
from app.engine.judged import ends_with
from app.engine.recording import BoolArray, FloatArray, Recording
from app.engine.simulate import Compression, keep, rebuild
from app.lab.testbench.seeded import write_lines
from app.lab.testbench.wiring import Lag, Pi, Valve, Wandering

INTERVAL_S, SAMPLES = 10.0, 29_880
HOUR = round(3600.0 / INTERVAL_S)
SETTLING = 3 * HOUR
NEVER = SAMPLES + SETTLING


@dataclass
class Plant:
    """One loop to be run scan by scan; what is done to it is of the sample of the record. stuck: samples between which
    the stem stands. upset: adds to the load, per cent of OP. stronger: what the load is multiplied by. strong: what the
    controller is multiplied by, from the sample on that is named.
    """

    rng: np.random.Generator
    process: str
    stuck: tuple[int, int] = (NEVER, NEVER)
    sp: Callable[[int], float] = lambda k: 50.0
    upset: Callable[[int], float] = lambda k: 0.0
    stronger: Callable[[int], float] = lambda k: 1.0
    strong: tuple[int, float] = (NEVER, 1.0)
    S: float = 0.2
    proportional: bool = False
    frozen_from: int = NEVER

    def run(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(N,) each: SP, PV and OP."""
        rng = self.rng
        tau_s = float(rng.choice((6.0, 25.0, 150.0))) * float(rng.uniform(0.7, 1.4))
        K, noise = float(rng.uniform(0.7, 1.3)), float(rng.uniform(0.05, 0.2))
        theta = 1 + round(float(rng.uniform(0.15, 0.5)) * tau_s / INTERVAL_S)
        hold_s = float(rng.choice((200.0, 600.0, 1800.0))) * float(rng.uniform(0.7, 1.4))
        closed_s = max(theta * INTERVAL_S, 0.5 * tau_s) * float(rng.uniform(1.0, 2.5))
        pi = {
            "flow": Pi(0.7 * tau_s / (K * (closed_s + theta * INTERVAL_S)), tau_s, 50.0),
            "slow": Pi(float(rng.uniform(0.05, 0.3)) / K, tau_s * float(rng.uniform(20.0, 100.0)), 50.0),
            "level": Pi(hold_s / (0.4 * hold_s + INTERVAL_S), 4.0 * (0.4 * hold_s + INTERVAL_S), 50.0),
        }[self.process]
        if self.proportional:
            pi = Pi(float(rng.uniform(0.8, 2.0)), math.inf, 50.0)
        load = Wandering(rng, float(rng.uniform(1.0, 3.0)), float(rng.uniform(900.0, 9000.0)))
        valve, lag = Valve(50.0, self.S, 0.25 * self.S), Lag(K, tau_s, theta)
        level, position, n = 0.0, 50.0, SAMPLES + SETTLING
        rows, white = np.empty((3, n)), noise * rng.standard_normal(n)
        pv = 50.0
        for i in range(n):
            k = i - SETTLING
            pushed = position - 50.0 + 2.0 + self.stronger(k) * load.after(INTERVAL_S) + self.upset(k)
            if self.process == "level":
                level = min(max(level + pushed * INTERVAL_S / hold_s, -50.0), 50.0)
            else:
                level = lag.after(pushed, INTERVAL_S)
            pv = pv if k >= self.frozen_from else round(min(max(50.0 + level + white[i], 0.0), 100.0), 2)
            op = pi.output(self.sp(k) - pv, INTERVAL_S, self.strong[1] if k >= self.strong[0] else 1.0)
            if not self.stuck[0] <= k < self.stuck[1]:
                position = valve.to(op)
            rows[:, i] = self.sp(k), pv, round(op, 2)
        return rows[0, SETTLING:], rows[1, SETTLING:], rows[2, SETTLING:]


PROCESSES = ("flow", "level", "slow")

Made = tuple[FloatArray, FloatArray, FloatArray, BoolArray | None]
"""SP, PV, OP and mode."""


def _with_mode(rows: tuple[FloatArray, FloatArray, FloatArray]) -> Made:
    return (*rows, np.ones(SAMPLES, np.bool_))


def _plain(p: Plant) -> Made:
    return _with_mode(p.run())


def _frozen(hours: float, seams: int) -> Callable[[Plant], Made]:
    """A restart of the transmitter gives another value that is as dead, after some samples of zero."""

    def made(p: Plant) -> Made:
        first = SAMPLES - round(hours * HOUR)
        sp, pv, op = replace(p, frozen_from=first).run()
        for seam in range(seams):
            at = SAMPLES - round((SAMPLES - max(first, 0)) * (seam + 1) / (seams + 1))
            pv[at:] += float(p.rng.choice((-1.0, 1.0))) * float(p.rng.uniform(0.05, 0.5))
            pv[at : at + int(p.rng.integers(0, 4))] = 0.0
        return _with_mode((sp, pv, op))

    return made


def _moved(p: Plant, times: list[float], size: float = 5.0) -> Callable[[int], float]:
    """The set point, moved so many hours before the end, to and fro about where it was."""
    at = [SAMPLES - round(hours * HOUR) for hours in sorted(times, reverse=True)]
    values = [50.0]
    for _ in at:
        way = float(p.rng.choice((-1.0, 1.0))) if values[-1] == 50.0 else math.copysign(1.0, 50.0 - values[-1])
        values.append(values[-1] + way * float(p.rng.uniform(0.6, 1.4)) * size)
    return lambda k: values[int(np.searchsorted(at, k, side="right"))]


def _stuck(hours: float, moves: list[float]) -> Callable[[Plant], Made]:
    first = SAMPLES - round(hours * HOUR)
    return lambda p: _with_mode(replace(p, stuck=(first, NEVER), sp=_moved(p, moves)).run())


def _follows(moves: list[float], size: float) -> Callable[[Plant], Made]:
    return lambda p: _with_mode(replace(p, sp=_moved(p, moves, size)).run())


def _upset(hours: float, until: float, size: float) -> Callable[[Plant], Made]:
    first, last = SAMPLES - round(hours * HOUR), SAMPLES - round(until * HOUR)
    return lambda p: _with_mode(replace(p, upset=lambda k: size if first <= k < last else 0.0).run())


def _louder(hours: float, times: float) -> Callable[[Plant], Made]:
    first = SAMPLES - round(hours * HOUR)
    return lambda p: _with_mode(replace(p, stronger=lambda k: times if k >= first else 1.0).run())


def _too_strong(p: Plant) -> Made:
    return _with_mode(replace(p, strong=(SAMPLES - 20 * HOUR, 6.0)).run())


def _coarse(step: float, S: float | None = None) -> Callable[[Plant], Made]:
    def made(p: Plant) -> Made:
        sp, pv, op = (p if S is None else replace(p, S=S)).run()
        return _with_mode((sp, step * np.rint(pv / step), op))

    return made


def _stored(kind: Compression) -> Callable[[Plant], Made]:
    """The historian stores what is away by 1 %: held in between, or on straight lines."""

    def made(p: Plant) -> Made:
        sp, pv, op = p.run()
        time_s = INTERVAL_S * np.arange(SAMPLES, dtype=np.float64)
        return _with_mode((sp, np.round(rebuild(time_s, pv, keep(time_s, pv, 1.0, kind), kind), 2), op))

    return made


def _manual(known: bool, hours: float, steps: int) -> Callable[[Plant], Made]:
    """By hand at the end, the unit at rest: PV stands, OP is set to some values and then left."""

    def made(p: Plant) -> Made:
        sp, pv, op = p.run()
        first = SAMPLES - round(hours * HOUR)
        pv[first:] = pv[first]
        at = np.linspace(first, first + HOUR, steps + 1).astype(int)
        for k, a in enumerate(at):
            op[a:] = round(op[first - 1] * (1.0 - k / steps), 2) if steps else op[first]
        automatic = np.arange(SAMPLES) < first
        return sp, pv, op, automatic if known else None

    return made


def _shut(hours: float, sp_too: bool, pv_to: float | None, ramp: float) -> Callable[[Plant], Made]:
    """The unit is shut down: OP, and SP where it is set too, go to 0 within so many hours; PV goes to a value, or
    stands where it was."""

    def made(p: Plant) -> Made:
        sp, pv, op = p.run()
        first = SAMPLES - round(hours * HOUR)
        left = np.clip(1.0 - (np.arange(SAMPLES) - first) / max(ramp * HOUR, 1.0), 0.0, 1.0)
        op = np.round(op * left, 2)
        sp = sp * left if sp_too else sp
        pv[first:] = (
            pv[first] if pv_to is None else np.where(left[first:] > 0.06, np.round(pv * left, 2)[first:], pv_to)
        )
        return _with_mode((sp, pv, op))

    return made


def _on_off(p: Plant) -> Made:
    sp, pv, op = p.run()
    on, level = True, 50.0
    for k in range(SAMPLES):
        level += (1.0 if on else -1.0) * INTERVAL_S / 60.0
        on = level < 55.0 if on else level < 45.0
        pv[k], op[k] = round(level, 0), 100.0 if on else 0.0
    return _with_mode((sp, pv, op))


def _empty(p: Plant) -> Made:
    """A level below its set point, its valve shut by the controller, and nothing flows: stored to 0.5 %."""
    sp, pv, op = p.run()
    first = SAMPLES - 20 * HOUR
    fall = np.clip((np.arange(SAMPLES) - first) / HOUR, 0.0, 1.0)
    pv, op = np.round(2.0 * (pv - 15.0 * fall)) / 2.0, np.round(op * (1.0 - fall), 2)
    pv[first + HOUR :] = pv[first + HOUR]
    return _with_mode((sp, pv, op))


def _mended(p: Plant) -> Made:
    sp, pv, op, _ = _frozen(30.0, 1)(p)
    fresh = _plain(replace(p, rng=np.random.default_rng(7)))
    last = slice(SAMPLES - 5 * HOUR, None)
    sp[last], pv[last], op[last] = (x[last] for x in fresh[:3])
    return _with_mode((sp, pv, op))


def _freed(p: Plant) -> Made:
    return _with_mode(
        replace(p, stuck=(SAMPLES - 40 * HOUR, SAMPLES - 12 * HOUR), sp=_moved(p, [35, 30, 22, 16])).run()
    )


def _no_sp(made: Callable[[Plant], Made]) -> Callable[[Plant], Made]:
    def without(p: Plant) -> Made:
        _, pv, op, automatic = made(p)
        return np.full(SAMPLES, np.nan), pv, op, automatic

    return without


FAULTS: dict[str, tuple[float, Callable[[Plant], Made]]] = {
    "frozen for 4 h": (4.0, _frozen(4.0, 0)),
    "frozen for 17 h": (17.0, _frozen(17.0, 0)),
    "frozen for 41 h, one restart": (41.0, _frozen(41.0, 1)),
    "frozen for 41 h, two restarts": (41.0, _frozen(41.0, 2)),
    "frozen for 41 h, one restart, no SP": (41.0, _no_sp(_frozen(41.0, 1))),
    "frozen for 83 h, two restarts": (83.0, _frozen(83.0, 2)),
    "stuck for 12 h, two moves of SP": (12.0, _stuck(12.0, [8, 4])),
    "stuck for 24 h": (24.0, _stuck(24.0, [])),
    "stuck for 48 h": (48.0, _stuck(48.0, [])),
    "stuck for 48 h, four moves of SP": (48.0, _stuck(48.0, [40, 30, 20, 8])),
    "stuck for 48 h, four moves, no SP": (48.0, _no_sp(_stuck(48.0, [40, 30, 20, 8]))),
}
"""By their names, with the hours before the end at which it happened."""

INNOCENT: dict[str, Callable[[Plant], Made]] = {
    "healthy": _plain,
    "healthy, no SP": _no_sp(_plain),
    "set point moved, 4 times": _follows([40, 30, 20, 8], 5.0),
    "set point moved by 25 %, 4 times": _follows([40, 30, 20, 8], 25.0),
    "set point moved by 20 %, 10 min before": _follows([1 / 6], 20.0),
    "set point moved by 20 %, 1 h before": _follows([1.0], 20.0),
    "load of 30 % to the end": _upset(10.0, 0.0, -30.0),
    "load of 70 % to the end, OP at its limit": _upset(20.0, 0.0, -70.0),
    "load of 70 %, over": _upset(20.0, 8.0, -70.0),
    "load of 70 % up to 20 min before": _upset(20.0, 1 / 3, -70.0),
    "load wanders 10 times as much": _louder(24.0, 10.0),
    "load wanders 30 times as much": _louder(40.0, 30.0),
    "proportional control, load 10 times": lambda p: _louder(24.0, 10.0)(replace(p, proportional=True)),
    "controller 6 times too strong": _too_strong,
    "sticks, S 5 %": lambda p: _plain(replace(p, S=5.0)),
    "sticks, S 10 %, PV to 0.5 %": _coarse(0.5, S=10.0),
    "PV to 0.5 %": _coarse(0.5),
    "PV to 2 %": _coarse(2.0),
    "PV to 2 %, no SP": _no_sp(_coarse(2.0)),
    "PV to 2 %, load 5 times": lambda p: _coarse(2.0)(replace(p, stronger=lambda k: 5.0 if k > SAMPLES // 2 else 1.0)),
    "stored on lines": _stored("swinging_door"),
    "stored by exception": _stored("exception"),
    "manual, mode known": _manual(True, 20.0, 20),
    "manual, mode not known, 4 values": _manual(False, 20.0, 4),
    "shut, OP and SP at 0, PV at 0": _shut(20.0, True, 0.0, 0.0),
    "shut within 1 h, OP, SP and PV to 0": _shut(20.0, True, 0.0, 1.0),
    "shut, OP and SP at 0, PV stands": _shut(20.0, True, None, 0.0),
    "shut, OP at 0, SP left, PV stands": _shut(20.0, False, None, 0.0),
    "shut, OP at 0, SP left, PV at 0": _shut(20.0, False, 0.0, 0.0),
    "on/off": _on_off,
    "level that nothing fills": _empty,
    "frozen, mended 5 h before": _mended,
    "stuck, freed 12 h before": _freed,
}


def recording_of(made: Callable[[Plant], Made], process: str, seed: int) -> Recording:
    rng = np.random.default_rng([seed, len(process)])
    sp, pv, op, automatic = made(Plant(rng, process))
    known = None if np.all(np.isnan(sp)) else sp
    return Recording(f"{process} {seed}", INTERVAL_S * np.arange(SAMPLES, dtype=np.float64), pv, op, known, automatic)


@dataclass(frozen=True)
class Told:
    """today: whether it is to be looked at today by its newest hours. off_h: by how much the hour since when is off.
    wound_up: whether it is asked why OP stands at its limit instead.
    """

    today: bool
    off_h: float | None
    wound_up: bool


def told(recording: Recording, hours: float) -> Told:
    """As the audit asks, without all that it asks besides."""
    fitness = assess(recording)
    stands, record = fitness.standstill, fitness.record
    stem = None if stands or record is None or not ends_with(record, recording) else stuck_stem(record)
    found = stands or stem
    off_h = None if found is None else abs(found.for_s / 3600.0 - min(hours, SAMPLES / HOUR))
    return Told(found is not None, off_h, found is None and fitness.wound_up_s is not None)


def line(name: str, all_told: list[Told]) -> str:
    off_h = [one.off_h for one in all_told if one.off_h is not None]
    off = f"{np.median(off_h):.1f} h" if off_h else ""
    today, wound_up = (sum(getattr(one, what) for one in all_told) for what in ("today", "wound_up"))
    return f"| {name} | {today} of {len(all_told)} | {off} | {wound_up} |"


def report(loops: int, seed: int, kinds: str) -> Iterator[str]:
    yield "| what happened | look today | hour off, median | asked why OP is at its limit |"
    yield "|---|---|---|---|"
    cases = {**FAULTS, **{name: (0.0, made) for name, made in INNOCENT.items()}}
    for name, (hours, made) in cases.items():
        if kinds in name:
            for process in PROCESSES:
                found = [told(recording_of(made, process, seed + k), hours) for k in range(loops)]
                yield line(f"{name}: {process}", found)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m app.lab.testbench.standstills", description=__doc__)
    parser.add_argument("--loops", type=int, default=6, help="of each kind and process")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", default="", help="those only whose name has this in it")
    options = parser.parse_args(arguments)
    write_lines(report(options.loops, options.seed, options.kinds))
    return 0


if __name__ == "__main__":
    sys.exit(main())
