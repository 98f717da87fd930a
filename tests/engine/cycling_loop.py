"""What tests of fitness are about: a loop that cycles, and what was found of its record."""

import numpy as np

from app.engine.fitness import Fitness
from app.engine.recording import Recording

N = 400


def cycling(n: int = N, **changed) -> Recording:
    """A loop that cycles every 40 samples, PV a quarter period behind OP, with some noise; `changed` replaces parts."""
    t = np.arange(n, dtype=float)
    noise = np.random.default_rng(1).normal(size=(2, n))
    parts = {
        "name": "loop",
        "time_s": t,
        "pv": 20.0 + 2.0 * np.sin(2 * np.pi * t / 40) + 0.05 * noise[0],
        "op": 50.0 + 5.0 * np.cos(2 * np.pi * t / 40) + 0.05 * noise[1],
        "sp": np.full(n, 20.0),
    }
    return Recording(**(parts | changed))


def outcomes(fitness: Fitness) -> dict[str, str]:
    return {finding.code: finding.outcome for finding in fitness.findings}


def refused(fitness: Fitness) -> list[str]:
    return [finding.code for finding in fitness.refusals]
