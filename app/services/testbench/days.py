"""`python -m app.services.testbench.days`: records of days, under loads that wander and step, some with a shutdown.

As historians hand them over: the load is the strongest movement of the whole, a limit cycle of minutes is within it.
Prints, night by night of the same loops, how many valves are called sticky and cleared, and how many verdicts of
consecutive nights contradict each other reliably. The valves of healthy loops have a band of 0.2 % too.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from app.engine.audit import audit
from app.engine.judgement import Judgement
from app.engine.recording import Recording
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop
from app.engine.simulate.plant import Plant

INTERVAL_S, DAY_S = 10.0, 86_400.0
NIGHTS, WINDOW_DAYS = 4, 3.5
HEALTHY_S, HEALTHY_J = 0.2, 0.05
STICKING = ((1.0, 2.0), (2.0, 4.0), (4.0, 10.0))
SHUT_FOR_S = 10 * 3600.0
_LIMITS = (0.0, 100.0)


@dataclass(frozen=True)
class Loop:
    """What is known of a loop, and what each night said. group: its S in per cent of OP's span, or "healthy"."""

    group: str
    nights: tuple[Judgement, ...]


def audited(seed: int, S: tuple[float, float] | None, shut: bool) -> Loop:
    """A loop of NIGHTS nights, each with the record of the WINDOW_DAYS before it.

    S: bounds of the stiction of its valve, per cent of OP's span; None: healthy. shut: the unit stands still for ten
    hours in the last day.
    """
    rng = np.random.default_rng([seed, 0 if S is None else round(10 * S[1])])
    recording = _recorded(rng, seed, S, shut)
    size = round(WINDOW_DAYS * DAY_S / INTERVAL_S)
    ends = recording.samples - np.arange(NIGHTS)[::-1] * round(DAY_S / INTERVAL_S)
    nights = (audit(_from_its_start(recording.part(slice(int(end) - size, int(end))))).judgement for end in ends)
    return Loop("healthy" if S is None else f"S {S[0]:g} to {S[1]:g} %", tuple(nights))


def _recorded(rng: np.random.Generator, seed: int, S: tuple[float, float] | None, shut: bool) -> Recording:
    length_s = (NIGHTS - 1 + WINDOW_DAYS) * DAY_S
    size = HEALTHY_S if S is None else float(rng.uniform(*S))
    jump = HEALTHY_J if S is None else size * float(rng.uniform(0.3, 1.0))
    plant, controller, noise_sd = _process(rng)
    spec = LoopSpec(
        plant=plant,
        controller=controller,
        valve=TwoParameterValve(size, jump),
        load=Signal(value=2.0, steps=tuple(_steps(rng, length_s)), noise_sd=float(rng.uniform(1.0, 3.0)),
                    noise_tau_s=float(rng.uniform(900.0, 9000.0))),
        noise=Signal(noise_sd=noise_sd),
        pv_start=50.0, op_start=50.0, op_limits=_LIMITS, pv_limits=_LIMITS, step_s=2.0, settle_s=3600.0,
    )  # fmt: skip
    made = simulate_loop(spec, length_s, INTERVAL_S, seed).recording(f"loop {seed}")
    pv, op = np.round(made.pv, 2), np.round(made.op, 2)
    if shut:
        first = made.samples - round((DAY_S / 2 + SHUT_FOR_S) / INTERVAL_S)
        stands = slice(first, first + round(SHUT_FOR_S / INTERVAL_S))
        op[stands], pv[stands] = 0.0, np.round(0.1 * np.abs(rng.standard_normal(stands.stop - stands.start)), 2)
    return replace(made, pv=pv, op=op, op_range=None, pv_range=None)


def _process(rng: np.random.Generator) -> tuple[Plant, Pid, float]:
    """A flow, a pressure or a temperature, tuned by internal model control, and the noise of its measurement."""
    tau_s = float(rng.choice([6.0, 25.0, 150.0])) * float(rng.uniform(0.7, 1.4))
    theta_s, K = tau_s * float(rng.uniform(0.15, 0.5)), float(rng.uniform(0.7, 1.3))
    closed_s = max(theta_s, 0.5 * tau_s) * float(rng.uniform(1.0, 2.5))
    return first_order(K, tau_s, theta_s), Pid(tau_s / (K * (closed_s + theta_s)), tau_s), float(rng.uniform(0.05, 0.2))


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


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m app.services.testbench.days", description=__doc__)
    parser.add_argument("--loops", type=int, default=20, help="of each kind")
    parser.add_argument("--seed", type=int, default=1000)
    options = parser.parse_args(arguments)
    seeds = range(options.seed, options.seed + options.loops)
    for shut in (False, True):
        loops = [audited(seed, S, shut) for S in (None, *STICKING) for seed in seeds]
        sys.stdout.write("\nwith a shutdown of ten hours in the last day\n" if shut else "")
        sys.stdout.writelines(f"{line}\n" for line in report(loops))
    return 0


if __name__ == "__main__":
    sys.exit(main())
