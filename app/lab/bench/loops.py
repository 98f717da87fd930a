"""Simulated loops of a plant: the conditions of the demo plant, each loop with its own tuning and its own noises."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from app.engine.recording import FloatArray
from app.engine.simulate import LoopSpec, Pid, simulate_loop
from app.services.demo import INTERVAL_S, SAMPLES, plant

SEED = 14_000
MINUTE_NS = 60_000_000_000
START_NS = 1_767_225_600_000_000_000  # 2026-01-01 UTC
SIGNALS = ("PV", "OP", "SP")


@dataclass(frozen=True, eq=False)
class SimulatedRecord:
    """A loop's day: 1,440 samples, one a minute by their stamps."""

    tag: str
    unit: str
    pv: FloatArray
    op: FloatArray
    sp: FloatArray


def times_ns(samples: int = SAMPLES) -> np.ndarray:
    return START_NS + np.arange(samples, dtype=np.int64) * MINUTE_NS


def records(count: int, samples: int = SAMPLES) -> Iterator[SimulatedRecord]:
    """`count` loops, no two alike, the same in every run."""
    kinds = plant()
    rng = np.random.default_rng(SEED)
    for index in range(count):
        kind = kinds[index % len(kinds)]
        spec = _own(kind.spec, float(rng.uniform(0.9, 1.1)))
        loop = simulate_loop(spec, samples * INTERVAL_S, INTERVAL_S, SEED + index)
        # As a historian keeps them: six digits, not seventeen.
        pv, op, sp = (np.round(values, 4) for values in (loop.pv, loop.op, loop.sp))
        yield SimulatedRecord(f"{kind.tag[:3]}{index:05d}", kind.unit, pv, op, sp)


def _own(spec: LoopSpec, share: float) -> LoopSpec:
    pid = spec.controller
    return replace(spec, controller=replace(pid, Kc=pid.Kc * share)) if isinstance(pid, Pid) else spec
