"""Asks `explain` about sound loops of any length beside the right simulation: `python long_clean.py [--samples N ...]
[--noise KIND ...] [--seeds N]`. Nothing is missing in any of them.
"""

import argparse
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

sys.path.insert(0, str(Path(__file__).parents[2]))

from app.engine.mismatch import Comparison, Explanation, explain
from app.engine.recording import FloatArray

NOISES = ("white", "one_pole", "two_poles", "complex_poles")
SET_POINTS = ("steps", "rest")
FINE = 6  # steps of the lags within a sample


@dataclass
class Loop:
    """Lags in a row behind a dead time (samples), and its PI controller. Interval 1 s."""

    gain: float
    taus: FloatArray
    late: int
    kc: float
    ti: float

    @cached_property
    def stays(self) -> list[float]:
        """What of each lag's level is left after a fine step."""
        return np.exp(-1.0 / FINE / self.taus).tolist()


def random_loop(rng: Generator) -> Loop:
    tau, late, order = rng.uniform(8.0, 28.0), int(rng.integers(1, 7)), int(rng.choice([1, 1, 2]))
    taus = np.array([tau] if order == 1 else [tau, tau * rng.uniform(0.2, 0.7)])
    gain = float(rng.uniform(0.55, 1.5))
    closed = rng.uniform(1.0, 2.5) * (late + 0.3 * tau + taus[1:].sum())
    return Loop(gain, taus, late, tau / (gain * (closed + late)), min(tau, 4.0 * (closed + late)))


def set_point(rng: Generator, n: int, kind: str, tau: float) -> FloatArray:
    sp, at = np.zeros(n), int(5 + 4 * tau)
    while kind == "steps" and at < n:
        sp[at:] = rng.uniform(-9.0, 9.0)
        at += int(rng.uniform(8.0, 22.0) * tau)
    return sp


def load_of(rng: Generator, e: FloatArray, kind: str, tau: float) -> FloatArray:
    """A load (N,) made of white noise e (N,), of unit deviation or none at all."""
    if kind == "white":
        return np.zeros(len(e))
    if kind == "one_pole":
        pole = np.clip(1.0 - 1.0 / (tau * rng.uniform(0.3, 2.0)), 0.5, 0.985)
        weights = [1.0, -pole]
    elif kind == "two_poles":
        weights = np.convolve([1.0, -rng.uniform(0.5, 0.9)], [1.0, -rng.uniform(0.9, 0.99)])
    else:
        radius, turn = rng.uniform(0.85, 0.97), 2.0 * np.pi / (tau * rng.uniform(2.0, 6.0))
        weights = [1.0, -2.0 * radius * np.cos(turn), radius**2]
    load = lfilter([1.0], weights, e)
    return np.asarray(load / np.std(load))


def run(loop: Loop, sp: FloatArray, load: FloatArray, white: FloatArray) -> tuple[FloatArray, FloatArray]:
    """OP and PV (N,) of the closed loop."""
    op, pv, levels, integral = np.zeros(len(sp)), np.zeros(len(sp)), [0.0] * len(loop.taus), 0.0
    for t in range(len(sp)):
        pv[t] = levels[-1] + white[t]
        error = sp[t] - pv[t]
        integral += loop.kc * error / loop.ti
        op[t] = loop.kc * error + integral
        advance(loop, levels, loop.gain * (op[t - loop.late] if t >= loop.late else 0.0) + load[t])
    return op, pv


def simulated(loop: Loop, op: FloatArray) -> FloatArray:
    """(N,) the process along OP, as it is."""
    trace, levels = np.zeros(len(op)), [0.0] * len(loop.taus)
    for t in range(len(op)):
        trace[t] = levels[-1]
        advance(loop, levels, loop.gain * (op[t - loop.late] if t >= loop.late else 0.0))
    return trace


def advance(loop: Loop, levels: list[float], drive: float) -> None:
    """Moves the levels by one sample, in place; by plain numbers, because each of numpy's takes ten times as long."""
    drive = float(drive)
    for _ in range(FINE):
        before = drive
        for k, stay in enumerate(loop.stays):
            levels[k] = before = stay * levels[k] + (1.0 - stay) * before


def case(seed: int, n: int, noise: str, sp_kind: str) -> Comparison:
    rng = np.random.default_rng(seed)
    loop = random_loop(rng)
    sp = set_point(rng, n, sp_kind, loop.taus[0])
    e, w = rng.standard_normal(n), rng.standard_normal(n)
    white = rng.uniform(0.06, 0.2) * w
    load = load_of(rng, e, noise, loop.taus[0]) * rng.uniform(0.2, 0.9) * (3.0 if sp_kind == "rest" else 1.0)
    op, pv = run(loop, sp, load, white)
    return Comparison(f"{noise}-{sp_kind}-{seed}", 1.0, op + 50.0, pv + 50.0, sp + 50.0, trace=simulated(loop, op))


def accused(said: Explanation) -> bool:
    return bool(said.effects) or any(reason.code == "parameters_off" for reason in said.evidence)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--samples", type=int, nargs="+", default=[4000, 10_000, 20_000, 40_000])
    options.add_argument("--noise", choices=NOISES, nargs="+", default=NOISES)
    options.add_argument("--seeds", type=int, default=3)
    given = options.parse_args()
    for n in given.samples:
        for noise in given.noise:
            for sp_kind in SET_POINTS:
                said = [explain(case(seed, n, noise, sp_kind)) for seed in range(given.seeds)]
                print(f"{n} {noise}, SP {sp_kind}: accused {sum(map(accused, said))} of {len(said)}", flush=True)


if __name__ == "__main__":
    main()
