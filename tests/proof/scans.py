"""What `explain` says where a controller scans several times between two samples of the record: `python scans.py
[--scans N...] [--count N] [--seed N] [--kinds K...] [--out FILE]`.

Loops of one lag or two under PI control and a load, of which one scan in N is recorded: valves that stick by five
forms, with a backlash, sound ones, and further effects; each beside a simulation that is right but for what is missing,
and beside none.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, compile_kernels, explain
from app.engine.simulate import LinearValve, LoopSpec, Pid, Signal, TwoParameterValve, Valve, Wave, simulate_loop
from app.engine.simulate import Plant as Process
from app.lab.testbench.building import random_steps
from tests.proof.sizes import FORMS, SHORT, load_of, valve_of

# Of what is missing: what is right to say.
RIGHT = {
    "clean": (),
    "limit cycle": ("valve.stiction",),
    "valve.stiction": ("valve.stiction",),
    "valve.deadband": ("valve.deadband",),
    "sensor.lag": ("sensor.lag", "process.extra_lag"),
    "sensor.quantization": ("sensor.quantization",),
    "sensor.saturation": ("sensor.saturation", "process.overflow"),
    "disturbance.oscillation": ("disturbance.oscillation",),
    "disturbance.step": ("disturbance.step", "sensor.step"),
}
SURE = 0.9
STICKS = ("limit cycle", "valve.stiction")
# What a load that steps or wanders is rightly called too.
OF_LOADS = {
    1: ("disturbance.ramp", "sensor.drift", "disturbance.step", "sensor.step"),
    2: ("disturbance.step", "sensor.step"),
}


@dataclass(frozen=True)
class Made:
    """A loop and what it lacks. S: of the valve; 0 for one that does not stick. load: what its load is called too."""

    kind: str
    load: tuple[str, ...]
    form: str
    S: float
    comparison: Comparison
    simulation: LinearSimulation


def made(kind: str, k: int, seed: int, scans: int, forms: tuple[str, ...] = FORMS) -> Made:
    """The loop of a number: the same but for its noise for any number of scans."""
    rng = np.random.default_rng([seed, k])
    S, share = float(rng.uniform(3.0, 10.0)), float(rng.choice([0.2, 0.4, 0.6, 0.8, 1.0]))
    ts, kc, noise = (float(rng.choice(some)) for some in ([2.0, 5.0], [0.6, 1.0, 1.5], [0.05, 0.1, 0.2, 0.4]))
    two_lags, form = bool(rng.integers(2)), forms[k % len(forms)]
    taus, theta = ((15.0, 8.0), 4.0) if two_lags else ((20.0,), 3.0)
    loads, length_s = int(rng.integers(3)), SHORT * ts
    load = load_of(loads, S, length_s, rng)
    lag = (float(rng.uniform(0.3, 0.8)) * taus[0],) if kind == "sensor.lag" else ()
    valve: Valve = LinearValve()
    if kind in STICKS:
        valve = valve_of(form, S, share * S)
    elif kind == "valve.deadband":
        valve = TwoParameterValve(0.6 * S, 0.0)
    if kind == "disturbance.oscillation":
        load = replace(load, waves=(Wave(0.3 * S, float(rng.uniform(8.0, 25.0)) * taus[0]),))
    if kind == "disturbance.step":
        load = replace(load, steps=(*load.steps, (0.55 * length_s, 0.8 * S)))
    spec = LoopSpec(
        plant=process(1.0, (*taus, *lag), theta),
        controller=Pid(0.6 * kc if two_lags else kc, 25.0, 0.0),
        valve=valve,
        load=load,
        noise=Signal(noise_sd=noise),
        sp=Signal(steps=random_steps(S, 40.0 * ts, rng)) if kind != "limit cycle" else Signal(),
        pv_start=50.0,
        op_start=50.0,
        op_limits=(0.0, 100.0),
        pv_limits=(0.0, 50.0 + 0.8 * S) if kind == "sensor.saturation" else (-np.inf, np.inf),
        pv_resolution=4.0 * noise if kind == "sensor.quantization" else 0.0,
        step_s=ts / scans,
    )
    run = simulate_loop(spec, length_s, ts, seed * 100 + k)
    pv, op = np.round(run.pv, 2), np.round(run.op, 2)
    said, size = (form, S) if kind in STICKS else ("", 0.0)
    known = Comparison("loop", ts, op, pv, run.sp)
    return Made(kind, OF_LOADS.get(loads, ()), said, size, known, LinearSimulation(1.0, taus, theta))


def process(gain: float, taus: tuple[float, ...], theta: float) -> Process:
    below = np.array([1.0])
    for tau in taus:
        below = np.convolve(below, [tau, 1.0])
    return Process((gain,), tuple(below.tolist()), theta)


def asked(plan: tuple[str, int, int, bool], seed: int, forms: tuple[str, ...]) -> dict[str, object]:
    """What is said of a loop, kind, number, scans and whether a simulation is given, as one row."""
    kind, k, scans, given = plan
    loop = made(kind, k, seed, scans, forms)
    started = time.process_time()
    said = explain(replace(loop.comparison, simulation=loop.simulation) if given else loop.comparison)
    return {"kind": kind, "form": loop.form, "k": k, "scans": scans, "given": given, **judged(loop, said),
            "seconds": round(time.process_time() - started, 2)}  # fmt: skip


def judged(loop: Made, said: Explanation) -> dict[str, object]:
    """right: whether some name is right; alone: and none is false, what the load does counted as true."""
    names = [[e.code, *e.alternatives] for e in said.effects]
    right = set(RIGHT[loop.kind])
    false = [e for e in said.effects if not (right | set(loop.load)) & {e.code, *e.alternatives}]
    held, value = None, None
    for p in (p for e in said.effects if e.code in right for p in e.parameters if p.name == "S" and loop.S > 0.0):
        held, value = bool(p.low <= loop.S <= p.high), round(p.value / loop.S, 3)
    return {
        "verdict": said.verdict, "said": names,
        "probability": [round(e.probability, 3) for e in said.effects],
        "right": any(right & set(some) for some in names), "first": any(some[0] in right for some in names),
        "false": len(false), "sure": sum(e.probability > SURE for e in false),
        "gains": [round(e.gain, 1) for e in said.effects], "held": held, "size": value,
        "reasons": [reason.code for reason in said.evidence],
    }  # fmt: skip


def told(rows: list[dict]) -> Iterator[str]:
    """A line for each kind, number of scans and whether a simulation was given."""
    for key in sorted({(r["kind"], r["given"], r["scans"]) for r in rows}):
        of_it = [r for r in rows if (r["kind"], r["given"], r["scans"]) == key]
        sized = [r for r in of_it if r["held"] is not None]
        size = f"; S held by {sum(r['held'] for r in sized)} of {len(sized)}" if sized else ""
        how = "given" if key[1] else "no simulation"
        right, first, false, sure = (sum(r[what] for r in of_it) for what in ("right", "first", "false", "sure"))
        yield (
            f"{key[0]}, {how}, {key[2]} scans: named {right} of {len(of_it)} (first of its alternatives {first}), "
            f"nothing {sum(not r['said'] for r in of_it)}, false names {false} ({sure} of p > {SURE}){size}"
        )


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--scans", type=int, nargs="+", default=[1, 2, 5, 10])
    options.add_argument("--count", type=int, default=10, help="loops of each kind")
    options.add_argument("--seed", type=int, default=7)
    options.add_argument("--kinds", nargs="+", choices=tuple(RIGHT), default=tuple(RIGHT))
    options.add_argument("--forms", nargs="+", choices=FORMS, default=FORMS, help="of valves that stick")
    options.add_argument("--only", choices=("given", "none"), help="beside a simulation, or beside none")
    options.add_argument("--jobs", type=int, default=1, help="processes, one thread each")
    options.add_argument("--out", type=Path)
    given = options.parse_args()
    ways = {"given": (True,), "none": (False,), None: (True, False)}[given.only]
    plans = [(kind, k, n, way) for kind in given.kinds for n in given.scans for way in ways for k in range(given.count)]
    compile_kernels()
    rows = []
    with ProcessPoolExecutor(given.jobs) as pool:
        ask = partial(asked, seed=given.seed, forms=tuple(given.forms))
        for row in map(ask, plans) if given.jobs == 1 else pool.map(ask, plans):
            rows.append(row)
            if given.out:
                with given.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    for line in told(rows):
        print(line, flush=True)
    print(f"CPU seconds: mean {np.mean([r['seconds'] for r in rows]):.2f}")


if __name__ == "__main__":
    main()
