"""How often the intervals that explain states hold the truth: `sizes.py [--count N] [--seed N] [--all | --plants]`.

Loops whose effect has the engine's own form (else its S is another number): limit cycles at a constant set point, and
blind loops whose set point moves. `--all`: blind loops of every effect of which a size is known. `--plants`: sticking
valves of five forms whose controller scans five times a sample, in loops of one and two lags under loads, at constant
set points and at some that step, and in the last nights of `app.lab.testbench.days`.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from app.engine.mismatch import Comparison, compile_kernels, explain
from app.engine.mismatch.compare.even_grid import comparison_of
from app.engine.mismatch.compare.narrowing import narrowed
from app.engine.simulate import (
    LoopSpec,
    OneParameterValve,
    PhysicalActuator,
    Pid,
    Signal,
    TwoParameterValve,
    Valve,
    first_order,
    second_order,
    simulate_loop,
)
from app.engine.valve import CLASSIC
from app.lab.testbench import days
from app.lab.testbench.building import random_steps
from tests.proof.cases import make_case
from tests.proof.stems import SAMPLES, loop, recorded

OF_A_VALVE = ("valve.stiction", "valve.deadband")
SIZED = (
    *OF_A_VALVE, "valve.slew_limit", "valve.saturation", "process.dead_time", "process.extra_lag",
    "process.inverse_response", "sensor.saturation", "sensor.drift", "sensor.step", "disturbance.step",
    "disturbance.ramp", "disturbance.oscillation",
)  # fmt: skip
FORMS = ("he", "choudhury", "kano", "physical", "one_parameter")
SHORT, SCANS = 800, 5  # samples; scans a sample
Known = tuple[str, Comparison, dict[str, float]]
Stated = tuple[float, float, float, float]


def limit_cycles(count: int, seed: int) -> Iterator[Known]:
    """Loops around a first-order process under PI control, started by a step of load."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        S, J, noise = (float(rng.choice(sizes)) for sizes in ((4, 6, 8, 12), (1, 2, 3), (0.05, 0.1, 0.2, 0.4)))
        ts, kc = float(rng.choice([2.0, 5.0])), float(rng.choice([0.6, 1.0, 1.5]))
        start = Signal(steps=((0.0, 1.0),))
        spec = loop(TwoParameterValve(S, J), Pid(kc, 20.0, 0.0), first_order(1.0, 20.0, 2.0), start, noise=noise)
        yield "valve.stiction", recorded("loop", spec, SAMPLES, ts, seed + k), {"S": S, "J": J}


def blind(effect: str, count: int, seed: int) -> Iterator[Known]:
    for k in range(count):
        case = make_case(seed + k, (effect,), False)
        given = Comparison(case.name, case.ts, case.op, case.pv, case.sp, case.measured, trace=case.trace)
        yield effect, given, case.truth.sizes


def plants(count: int, seed: int, moves_sp: bool = False) -> Iterator[Known]:
    """Loops whose valve, process or load the engine may not have, of which one scan in SCANS is recorded."""
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        S, J = float(rng.uniform(3.0, 10.0)), float(rng.choice([0.2, 0.4, 0.6, 0.8, 1.0]))
        ts, kc, noise = (float(rng.choice(some)) for some in ([2.0, 5.0], [0.6, 1.0, 1.5], [0.05, 0.1, 0.2, 0.4]))
        two_lags = bool(rng.integers(2))
        spec = LoopSpec(
            plant=second_order(1.0, 12.0, 1.2, 4.0) if two_lags else first_order(1.0, 20.0, 3.0),
            controller=Pid(0.6 * kc if two_lags else kc, 25.0, 0.0),
            valve=valve_of(FORMS[k % len(FORMS)], S, J * S),
            load=load_of(int(rng.integers(3)), S, SHORT * ts, rng),
            noise=Signal(noise_sd=noise),
            sp=Signal(steps=random_steps(S, 40.0 * ts, rng)) if moves_sp else Signal(),
            pv_start=50.0,
            op_start=50.0,
            op_limits=(0.0, 100.0),
            step_s=ts / SCANS,
        )
        made = simulate_loop(spec, SHORT * ts, ts, seed * 100 + k)
        pv, op = np.round(made.pv, 2), np.round(made.op, 2)
        yield "valve.stiction", Comparison("loop", ts, op, pv, made.sp), {"S": S}


def valve_of(form: str, S: float, J: float) -> Valve:
    """A valve that lets go after S; the one-parameter valve slips by all of it, the physical one by its masses."""
    if form == "physical":
        friction_pct = 100.0 * (CLASSIC.F_s + CLASSIC.F_c) / (CLASSIC.k * CLASSIC.travel_m)
        return PhysicalActuator(CLASSIC, op_per_pct=S / friction_pct)
    return OneParameterValve(S) if form == "one_parameter" else TwoParameterValve(S, J, form)


def load_of(kind: int, S: float, length_s: float, rng: np.random.Generator) -> Signal:
    """A load that starts the loop; that wanders besides; that steps twice more."""
    started = Signal(steps=((0.0, 1.0),))
    if kind == 1:
        wanders, slow_s = float(rng.uniform(0.03, 0.2)), float(rng.uniform(100.0, 1500.0))
        return replace(started, noise_sd=wanders * S, noise_tau_s=slow_s)
    if kind == 2:
        later = ((share * length_s, float(rng.normal(0.0, 0.7 * S))) for share in (0.3, 0.7))
        return replace(started, steps=(*started.steps, *later))
    return started


def nights(count: int, seed: int) -> Iterator[Known]:
    """What audits judge of the last of four nights: flows with S of 2 to 10 %, levels with 4 to 10 %."""
    for process, sizes in (("flow", days.STICKING[1:]), ("level", days.STICKING[2:])):
        for S, k in product(sizes, range(seed, seed + count)):
            case = days.Case(days.PACES["seconds"], days.PROCESSES[process], k, S, False)
            yield "valve.stiction", narrowed(comparison_of(days.recorded_nights(case)[-1])), {"S": days.size_of(case)}


def stated(known: Iterator[Known]) -> dict[str, list[Stated]]:
    """By parameter: truth, value, low, high, of the loops in which the effect was named."""
    found: dict[str, list[Stated]] = {}
    for effect, comparison, sizes in known:
        for said in explain(comparison).effects:
            for p in said.parameters if said.code == effect else ():
                if p.name in sizes:
                    found.setdefault(p.name, []).append((sizes[p.name], p.value, p.low, p.high))
    return found


def told(what: str, found: dict[str, list[Stated]]) -> Iterator[str]:
    for name, rows in found.items():
        true, value, low, high = np.array(rows).T
        held = int(np.sum((low <= true) & (true <= high)))
        off, width = np.median(np.abs(value / true - 1.0)), np.median((high - low) / np.abs(true))
        short, long = int(np.sum(high < true)), int(np.sum(low > true))
        off_by = f"median error {off:.1%}, median width {width:.1%}"
        yield f"{what}, {name}: held by {held} of {len(rows)}, {short} too low and {long} too high, {off_by}"


def kinds_of(given: argparse.Namespace) -> dict[str, Iterator[Known]]:
    if given.plants:
        return {
            "limit cycles of other plants": plants(given.count, given.seed),
            "the same, set point moving": plants(given.count, given.seed, moves_sp=True),
            "nights": nights(given.count // 5, given.seed),
        }
    cycles = {} if given.all else {"limit cycles": limit_cycles(given.count, given.seed)}
    effects = SIZED if given.all else OF_A_VALVE
    return cycles | {f"blind, {effect}": blind(effect, given.count, given.seed) for effect in effects}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=40, help="loops of each kind")
    options.add_argument("--seed", type=int, default=3000)
    options.add_argument(
        "--all", action="store_true", help="blind loops of every effect with a size, in place of limit cycles"
    )
    options.add_argument("--plants", action="store_true", help="valves of other forms with scans between the samples")
    given = options.parse_args()
    compile_kernels()
    for what, known in kinds_of(given).items():
        for line in told(what, stated(known)):
            print(line, flush=True)


if __name__ == "__main__":
    main()
