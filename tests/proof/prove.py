"""Runs the explain engine blind over generated cases and prints what it named: `python prove.py [--count N]
[--forms own] ...`.
"""

import argparse
import json
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from app.engine.mismatch import Comparison, Explanation, compile_kernels, explain
from app.engine.recording import BoolArray
from tests.proof.cases import cut_out, make_case, planned
from tests.proof.generator import LEAST_ENERGY, SAME, Case
from tests.proof.outside import SETS, outside_summary, planned_outside
from tests.proof.strangers import mixed_up

# The shares of clean loops and of loops with two effects in a set.
SHARES = {
    "all": (0.25, 0.15), "clean": (1.0, 0.0), "one": (0.0, 0.0), "two": (0.0, 1.0), "strangers": (1.0, 0.0)
}  # fmt: skip
GAP = (10, 41)  # samples, the second not among them


def overlap(found: list[tuple[float, float]], true: list[tuple[float, float]]) -> float:
    """Intersection over union of two lists of windows."""
    edges = sorted({t for w in (*found, *true) for t in w})
    both = either = 0.0
    for a, b in pairwise(edges):
        inside = [any(s <= 0.5 * (a + b) < e for s, e in windows) for windows in (found, true)]
        both, either = both + (b - a) * all(inside), either + (b - a) * any(inside)
    return both / either if either else 0.0


def answer(case: Case, sim: bool, unknown: float = 0.0) -> tuple[Explanation, float]:
    """unknown: the share of the samples in which PV was not recorded."""
    started = time.process_time()
    trace, known = case.trace if sim else None, with_gaps(len(case.pv), unknown)
    pv = np.interp(np.arange(len(case.pv)), np.flatnonzero(known), case.pv[known])
    said = explain(
        Comparison(case.name, case.ts, case.op, pv, case.sp, case.measured, known if unknown else None, trace=trace)
    )
    return said, time.process_time() - started


def with_gaps(n: int, unknown: float) -> BoolArray:
    """(n,) False in gaps of GAP samples, anywhere but at the first sample, until about such a share is unknown."""
    rng, known = np.random.default_rng(n), np.ones(n, dtype=bool)
    while 1.0 - known.mean() < unknown:
        first = int(rng.integers(1, n))
        known[first : first + int(rng.integers(*GAP))] = False
    return known


def judged(case: Case, said: Explanation, seconds: float) -> dict[str, object]:
    """One line: what was true, what was said, what was right."""
    named = [{e.code, *e.alternatives} for e in said.effects]
    right = [any(set(SAME.get(t, (t,))) & names for names in named) for t in case.truth.effects]
    first = bool(named) and any(set(SAME.get(t, (t,))) & named[0] for t in case.truth.effects)
    windows = [(w.start_s, w.end_s) for w in said.effects[0].windows] if said.effects else []
    local = overlap(windows, list(case.truth.windows)) if case.truth.localise and len(case.truth.effects) == 1 else None
    return {
        "case": case.name, "true": case.truth.effects, "said": [[e.code, *e.alternatives] for e in said.effects],
        "gains": [round(e.gain, 1) for e in said.effects],
        "verdict": said.verdict, "probability": said.effects[0].probability if said.effects else None,
        "first_right": first, "all_right": all(right), "overlap": local, "energy": round(case.truth.energy, 1),
        "excess": excess(case, said), "seconds": seconds, "ts": case.ts,
        "before": said.fit.refitted.rmse, "after": said.fit.explained.rmse,
    }  # fmt: skip


def excess(case: Case, said: Explanation) -> float | None:
    """The held-out RMSE over that of the true model on the same samples; None where PV does not show it."""
    held = said.traces.held_out
    if case.truth.noise is None or len(held) != len(case.truth.noise) or not held.any():
        return None
    return said.fit.explained.rmse / float(np.sqrt(np.mean(case.truth.noise[held] ** 2)))


def one(
    plan: tuple[int, tuple[str, ...]],
    foreign: bool,
    sim: bool,
    running: bool,
    least: float = LEAST_ENERGY,
    unknown: float = 0.0,
    samples: int | None = None,
    strangers: bool = False,
) -> dict[str, object]:
    case = mixed_up(plan[0], foreign, samples) if strangers else make_case(*plan, foreign, least, samples)
    case = cut_out(case, plan[0]) if running else case
    return judged(case, *answer(case, sim, unknown))


def summary(lines: list[dict]) -> str:
    """Named right, accused, localisation, excess, seconds, confusions; of the cases whose effects can be seen."""
    seen = [x for x in lines if not x["true"] or x["energy"] >= LEAST_ENERGY]
    hidden, lines = len(lines) - len(seen), seen
    single = [x for x in lines if len(x["true"]) == 1]
    two = [x for x in lines if len(x["true"]) == 2]
    clean = [x for x in lines if not x["true"]]
    said = [f"left out, because an effect leaves an energy below {LEAST_ENERGY:g}: {hidden}"]
    said.append(f"one effect: first name right {sum(x['first_right'] for x in single)}/{len(single)}")
    said.append(
        f"two effects: both named {sum(x['all_right'] for x in two)}/{len(two)}, "
        f"first right {sum(x['first_right'] for x in two)}"
    )
    said.append(f"one effect, a second and false name: {sum(len(x['said']) > 1 for x in single)}/{len(single)}")
    said.append(f"clean accused {sum(bool(x['said']) for x in clean)}/{len(clean)}")
    overlaps = [x["overlap"] for x in single if x["overlap"] is not None]
    said.append(f"localisation overlap mean {np.mean(overlaps) if overlaps else float('nan'):.3f} over {len(overlaps)}")
    excess = [x["excess"] for x in single if x["excess"]]
    said.append(
        "held-out RMSE over the true model's on the same samples: median "
        f"{np.median(excess) if excess else float('nan'):.3f}"
    )
    said.append(
        f"CPU seconds: median {np.median([x['seconds'] for x in lines]):.2f}, "
        f"most {max(x['seconds'] for x in lines):.2f}"
    )
    confusions = Counter(
        (x["true"][0], x["said"][0][0] if x["said"] else "nothing") for x in single if not x["first_right"]
    )
    said += [f"  {true} called {name}: {n}" for (true, name), n in confusions.most_common()]
    said += [f"  clean called {x['said'][0][0]} ({x['gains']})" for x in clean if x["said"]]
    return "\n".join(said)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--count", type=int, default=200)
    options.add_argument("--seed", type=int, default=7)
    options.add_argument("--forms", choices=("foreign", "own"), default="foreign", help="own: the engine's equations")
    options.add_argument("--kinds", choices=[*sorted(SHARES), *SETS], default="all", help="which cases")
    options.add_argument("--least-energy", type=float, default=LEAST_ENERGY, help="what an effect leaves at least")
    options.add_argument("--no-simulation", action="store_true")
    options.add_argument("--running", action="store_true", help="records cut out of loops that run already")
    options.add_argument("--unknown", type=float, default=0.0, help="share of PV that was not recorded, in gaps")
    options.add_argument("--samples", type=int, help="length of every record; without it 1,500 to 2,400")
    options.add_argument("--jobs", type=int, default=1, help="processes, one thread each")
    options.add_argument("--out", type=Path)
    given = options.parse_args()
    foreign = given.forms == "foreign"
    outside = given.kinds in SETS
    if outside:
        plans = planned_outside(given.seed, given.count, SETS[given.kinds])
    else:
        plans = planned(given.seed, given.count, *SHARES[given.kinds], foreign)
    sim = not given.no_simulation
    asked = partial(
        one,
        foreign=foreign,
        sim=sim,
        running=given.running,
        least=given.least_energy,
        unknown=given.unknown,
        samples=given.samples,
        strangers=given.kinds == "strangers",
    )
    compile_kernels()  # else the first case pays for it
    lines = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for line in map(asked, plans) if given.jobs == 1 else pool.map(asked, plans):
            lines.append(line)
            if given.out:
                with given.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(line, default=str) + "\n")
    print(outside_summary(lines) if outside else summary(lines))


if __name__ == "__main__":
    main()
