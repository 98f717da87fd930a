"""What the tests of mismatches send through a process: the moves of an operator and a controller, loads and noise."""

from functools import lru_cache

import numpy as np

from app.engine.recording import FloatArray


def moves(samples: int, held: int, seed: int = 3) -> FloatArray:
    """OP (samples,) as deviation: steps that hold for `held` samples, and the small moves of a controller."""
    return _moves(samples, held, seed).copy()


@lru_cache(maxsize=50)
def _moves(samples: int, held: int, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    steps, slow = np.repeat(rng.uniform(-6.0, 6.0, samples // held), held), np.zeros(samples)
    for t in range(1, samples):
        slow[t] = 0.97 * slow[t - 1] + 0.25 * rng.normal()
    return steps + slow


def noise(samples: int, seed: int = 4) -> FloatArray:
    """What PV (samples,) has of its own: a load that wanders, and the noise of the transmitter."""
    return _noise(samples, seed).copy()


@lru_cache(maxsize=50)
def _noise(samples: int, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    load = np.zeros(samples)
    for t in range(1, samples):
        load[t] = 0.93 * load[t - 1] + 0.06 * rng.normal()
    return load + 0.08 * rng.normal(size=samples)
