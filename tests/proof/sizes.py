"""How often the intervals that explain states of a valve hold the truth: `python sizes.py [--count N] [--seed N]`.

Loops whose valve is the engine's own form (else its S is another number): limit cycles at a constant set point, and
blind loops whose set point moves.
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
        off, width = np.median(np.abs(value / true - 1.0)), np.median((high - low) / true)
        yield f"{what}, {name}: held by {held} of {len(rows)}, median error {off:.1%}, median width {width:.0%}"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=40, help="loops of each kind")
    options.add_argument("--seed", type=int, default=3000)
    given = options.parse_args()
    compile_kernels()
    kinds = {
        "limit cycles": limit_cycles(given.count, given.seed),
        "blind, valve.stiction": blind("valve.stiction", given.count, given.seed),
        "blind, valve.deadband": blind("valve.deadband", given.count, given.seed),
    }
    for what, known in kinds.items():
        for line in told(what, stated(known)):
            print(line, flush=True)


if __name__ == "__main__":
    main()
