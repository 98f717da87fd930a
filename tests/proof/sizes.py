"""How often the intervals that explain states hold the truth: `python sizes.py [--count N] [--seed N] [--all]`.

Loops whose effect has the engine's own form (else its S is another number): limit cycles at a constant set point, and
blind loops whose set point moves. `--all`: blind loops of every effect of which a size is known.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from app.engine.mismatch import Comparison, compile_kernels, explain
from app.engine.simulate import Pid, Signal, TwoParameterValve, first_order
from tests.proof.cases import make_case
from tests.proof.stems import SAMPLES, loop, recorded

OF_A_VALVE = ("valve.stiction", "valve.deadband")
SIZED = (
    *OF_A_VALVE, "valve.slew_limit", "valve.saturation", "process.dead_time", "process.extra_lag",
    "process.inverse_response", "sensor.saturation", "sensor.drift", "sensor.step", "disturbance.step",
    "disturbance.ramp", "disturbance.oscillation",
)  # fmt: skip
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


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=40, help="loops of each kind")
    options.add_argument("--seed", type=int, default=3000)
    options.add_argument(
        "--all", action="store_true", help="blind loops of every effect with a size, in place of limit cycles"
    )
    given = options.parse_args()
    compile_kernels()
    kinds = {} if given.all else {"limit cycles": limit_cycles(given.count, given.seed)}
    for effect in SIZED if given.all else OF_A_VALVE:
        kinds[f"blind, {effect}"] = blind(effect, given.count, given.seed)
    for what, known in kinds.items():
        for line in told(what, stated(known)):
            print(line, flush=True)


if __name__ == "__main__":
    main()
