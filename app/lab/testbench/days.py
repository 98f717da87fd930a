"""`python -m app.lab.testbench.days`: records of days, under loads that wander and step, some with a shutdown.

As historians hand them over: the load is the strongest movement of the whole, a limit cycle of minutes is within it.
Prints, night by night of the same loops, how many valves are called sticky and cleared, and how many verdicts of
consecutive nights contradict each other reliably. The valves of healthy loops have a band of 0.2 % too.

With `--explain`, instead: what is named as missing from a linear loop in the record of the last night, in what its
audit judges of it or in the newest 20,000 samples of the whole.
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from app.engine.audit import audit
from app.engine.judgement import Judgement
from app.engine.mismatch import explain
from app.engine.mismatch.compare.even_grid import comparison_of
from app.engine.mismatch.compare.narrowing import narrowed
from app.engine.recording import Recording
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, integrator, simulate_loop
from app.engine.simulate.plant import Plant

DAY_S = 86_400.0
NIGHTS = 4
WHOLE_SAMPLES = 20_000
HEALTHY_S, HEALTHY_J = 0.2, 0.05
STICKING = ((1.0, 2.0), (2.0, 4.0), (4.0, 10.0))
SHUT_FOR_S = 10 * 3600.0
_LIMITS = (0.0, 100.0)


@dataclass(frozen=True)
class Pace:
    """interval_s: at which the historian stores. days: of a night's record.
    tau_s: time constants of processes; hold_s: in which a level runs over its span at OP 100 %; wander_s: bounds of the
    load's time constant.
    """

    interval_s: float
    days: float
    tau_s: tuple[float, ...]
    hold_s: tuple[float, ...]
    wander_s: tuple[float, float]

    @property
    def step_s(self) -> float:
        return self.interval_s / 5.0


PACES = {
    "seconds": Pace(10.0, 3.5, (6.0, 25.0, 150.0), (60.0, 200.0, 600.0), (900.0, 9000.0)),
    "minutes": Pace(60.0, 3.45, (60.0, 200.0, 600.0), (300.0, 900.0, 2400.0), (3600.0, 36_000.0)),
}


Process = Callable[[Pace, np.random.Generator], tuple[Plant, Pid]]


def _flow(pace: Pace, rng: np.random.Generator) -> tuple[Plant, Pid]:
    """A flow, a pressure or a temperature, tuned by internal model control."""
    tau_s = float(rng.choice(pace.tau_s)) * float(rng.uniform(0.7, 1.4))
    theta_s, K = tau_s * float(rng.uniform(0.15, 0.5)), float(rng.uniform(0.7, 1.3))
    closed_s = max(theta_s, 0.5 * tau_s) * float(rng.uniform(1.0, 2.5))
    return first_order(K, tau_s, theta_s), Pid(tau_s / (K * (closed_s + theta_s)), tau_s)


def _level(pace: Pace, rng: np.random.Generator) -> tuple[Plant, Pid]:
    """A level that holds its set point, tuned by Skogestad's rule for integrating processes."""
    hold_s = float(rng.choice(pace.hold_s)) * float(rng.uniform(0.7, 1.4))
    theta_s, closed_s = hold_s * float(rng.uniform(0.02, 0.1)), hold_s * float(rng.uniform(0.15, 0.6))
    return integrator(1.0 / hold_s, theta_s), Pid(hold_s / (closed_s + theta_s), 4.0 * (closed_s + theta_s))


def _slow(pace: Pace, rng: np.random.Generator) -> tuple[Plant, Pid]:
    """A flow whose controller takes hours over its load: a valve that sticks mostly stands fast, and hardly cycles."""
    tau_s, K = float(rng.choice(pace.tau_s)) * float(rng.uniform(0.7, 1.4)), float(rng.uniform(0.7, 1.3))
    return first_order(K, tau_s, 0.3 * tau_s), Pid(
        float(rng.uniform(0.05, 0.3)) / K, tau_s * float(rng.uniform(20, 100))
    )


PROCESSES: dict[str, Process] = {"flow": _flow, "level": _level, "slow": _slow}


@dataclass(frozen=True)
class Case:
    """A loop to simulate. S: bounds of the stiction of its valve, per cent of OP's span; None: healthy. shut: the unit
    stands still for ten hours in the last day.
    """

    pace: Pace
    process: Process
    seed: int
    S: tuple[float, float] | None
    shut: bool

    @property
    def group(self) -> str:
        return "healthy" if self.S is None else f"S {self.S[0]:g} to {self.S[1]:g} %"


@dataclass(frozen=True)
class Loop:
    """What is known of a loop, and what each of its NIGHTS nights said of the days before it."""

    group: str
    nights: tuple[Judgement, ...]


def audited(case: Case) -> Loop:
    return Loop(case.group, tuple(audit(night).judgement for night in recorded_nights(case)))


def recorded_nights(case: Case) -> list[Recording]:
    """What each night has of one loop, the newest last."""
    pace = case.pace
    recording = _recorded(case)
    size = round(pace.days * DAY_S / pace.interval_s)
    ends = recording.samples - np.arange(NIGHTS)[::-1] * round(DAY_S / pace.interval_s)
    return [_from_its_start(recording.part(slice(int(end) - size, int(end)))) for end in ends]


def size_of(case: Case) -> float:
    """S of its valve, per cent of OP's span."""
    return _size(case, _draws(case))


def _draws(case: Case) -> np.random.Generator:
    return np.random.default_rng([case.seed, 0 if case.S is None else round(10 * case.S[1])])


def _size(case: Case, rng: np.random.Generator) -> float:
    return HEALTHY_S if case.S is None else float(rng.uniform(*case.S))


def _recorded(case: Case) -> Recording:
    pace, rng = case.pace, _draws(case)
    length_s = (NIGHTS - 1 + pace.days) * DAY_S
    size = _size(case, rng)
    jump = HEALTHY_J if case.S is None else size * float(rng.uniform(0.3, 1.0))
    plant, controller = case.process(pace, rng)
    noise_sd = float(rng.uniform(0.05, 0.2))
    spec = LoopSpec(
        plant=plant,
        controller=controller,
        valve=TwoParameterValve(size, jump),
        load=Signal(value=2.0, steps=tuple(_steps(rng, length_s)), noise_sd=float(rng.uniform(1.0, 3.0)),
                    noise_tau_s=float(rng.uniform(*pace.wander_s))),
        noise=Signal(noise_sd=noise_sd),
        pv_start=50.0, op_start=50.0, op_limits=_LIMITS, pv_limits=_LIMITS, step_s=pace.step_s, settle_s=3600.0,
    )  # fmt: skip
    made = simulate_loop(spec, length_s, pace.interval_s, case.seed).recording(f"loop {case.seed}")
    pv, op = np.round(made.pv, 2), np.round(made.op, 2)
    if case.shut:
        first = made.samples - round((DAY_S / 2 + SHUT_FOR_S) / pace.interval_s)
        stands = slice(first, first + round(SHUT_FOR_S / pace.interval_s))
        op[stands], pv[stands] = 0.0, np.round(0.1 * np.abs(rng.standard_normal(stands.stop - stands.start)), 2)
    return replace(made, pv=pv, op=op, op_range=None, pv_range=None)


def _steps(rng: np.random.Generator, length_s: float) -> Iterator[tuple[float, float]]:
    at = float(rng.exponential(4 * 3600.0))
    while at < length_s:
        yield at, float(rng.normal(0.0, 1.0))
        at += float(rng.exponential(4 * 3600.0))


def _from_its_start(recording: Recording) -> Recording:
    return replace(recording, time_s=recording.time_s - recording.time_s[0])


def report(loops: list[Loop]) -> Iterator[str]:
    yield "| loops | nights | sticks | of these reliably | cleared reliably | other | reliable contradictions |"
    yield "|---|---|---|---|---|---|---|"
    for group in dict.fromkeys(loop.group for loop in loops):
        mine = [loop for loop in loops if loop.group == group]
        said = Counter(_said(night) for loop in mine for night in loop.nights)
        turned = sum({_said(a), _said(b)} == {"S!", "N!"} for loop in mine for a, b in pairwise(loop.nights))
        total = said.total()
        sticks, other = said["S"] + said["S!"], total - said["S"] - said["S!"] - said["N!"]
        shares = " | ".join(f"{100 * count / total:.0f} %" for count in (sticks, said["S!"], said["N!"], other))
        yield f"| {group} | {len(mine)} x {NIGHTS} | {shares} | {turned} |"


def _said(judgement: Judgement) -> str:
    letter = {"stiction": "S", "no_stiction": "N"}.get(judgement.verdict, "?")
    return letter + "!" * (judgement.reliability == "reliable")


@dataclass(frozen=True)
class Explained:
    """codes: of the effects that were named. elapsed_s: processor time, s."""

    group: str
    codes: tuple[str, ...]
    elapsed_s: float


def explained(case: Case, part: str) -> Explained:
    """The last night's record of a loop, explained beside our own linear loop. part: "judged" or "whole"."""
    comparison = comparison_of(recorded_nights(case)[-1])
    start = time.process_time()
    found = explain(narrowed(comparison) if part == "judged" else comparison.part(slice(-WHOLE_SAMPLES, None)))
    return Explained(case.group, tuple(effect.code for effect in found.effects), time.process_time() - start)


def report_explained(found: list[Explained]) -> Iterator[str]:
    yield "| loops | records | the valve named | only something else | nothing | median, s |"
    yield "|---|---|---|---|---|---|"
    for group in dict.fromkeys(one.group for one in found):
        mine = [one for one in found if one.group == group]
        named = sum("valve.stiction" in one.codes for one in mine)
        nothing = sum(not one.codes for one in mine)
        elapsed_s = float(np.median([one.elapsed_s for one in mine]))
        yield f"| {group} | {len(mine)} | {named} | {len(mine) - named - nothing} | {nothing} | {elapsed_s:.0f} |"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m app.lab.testbench.days", description=__doc__)
    parser.add_argument("--loops", type=int, default=20, help="of each kind")
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--pace", choices=list(PACES), default="seconds", help="of the historian and the processes")
    parser.add_argument("--process", choices=list(PROCESSES), default="flow")
    parser.add_argument("--explain", choices=["judged", "whole"])
    options = parser.parse_args(arguments)
    seeds = range(options.seed, options.seed + options.loops)
    process = PROCESSES[options.process]
    for shut in (False, True):
        kinds = [Case(PACES[options.pace], process, seed, S, shut) for S in (None, *STICKING) for seed in seeds]
        if options.explain:
            lines = report_explained([explained(case, options.explain) for case in kinds])
        else:
            lines = report([audited(case) for case in kinds])
        sys.stdout.write("\nwith a shutdown of ten hours in the last day\n" if shut else "")
        sys.stdout.writelines(f"{line}\n" for line in lines)
    return 0


if __name__ == "__main__":
    sys.exit(main())
