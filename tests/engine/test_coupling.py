"""Whether PV and OP have to do with each other: strangers pass for strangers, loops for loops, in any unit."""

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.coupling import strangers_chance
from app.engine.oscillation import detect
from app.engine.recording import UniformRecord

N = 900


def chance(pv: np.ndarray, op: np.ndarray) -> float:
    loop = UniformRecord(1.0, pv, op, None, np.zeros(len(pv), bool))
    return strangers_chance(loop, detect(loop))


def wandering(rng: np.random.Generator, pole: float) -> np.ndarray:
    return lfilter([1.0], [1.0, -pole], rng.normal(size=N + 200))[200:]


def swinging(rng: np.random.Generator, period: float) -> np.ndarray:
    return np.sin(2 * np.pi * np.arange(N) / period + rng.uniform(0, 6)) + 0.2 * rng.normal(size=N)


@pytest.mark.parametrize("kind", ["wandering", "swinging"])
def test_strangers_that_wander_or_swing_are_as_alike_as_chance_has_it(kind: str) -> None:
    rng = np.random.default_rng(4)
    if kind == "wandering":
        pairs = [(wandering(rng, 0.97), wandering(rng, 0.97)) for _ in range(100)]
    else:
        pairs = [(swinging(rng, 40.0), swinging(rng, 41.0)) for _ in range(100)]
    found = np.array([chance(*pair) for pair in pairs])
    assert np.mean(found < 0.05) <= 0.12
    assert np.mean(found < 1e-3) <= 0.02


@pytest.mark.parametrize("pole", [0.5, 0.97])
def test_an_answer_is_heard_through_noise_as_large(pole: float) -> None:
    rng = np.random.default_rng(5)
    op = wandering(rng, 0.9)
    answer = lfilter([0.0, 0.0, 1.0 - pole], [1.0, -pole], op)
    pv = answer + np.std(answer) * rng.normal(size=N)
    assert chance(pv, op) < 1e-3
    assert chance(-2.0 * pv + 7.0, 0.1 * op) == pytest.approx(chance(pv, op), rel=1e-6)


def test_of_a_short_or_standing_signal_nothing_is_known() -> None:
    rng = np.random.default_rng(6)
    op = wandering(rng, 0.9)
    assert chance(op[:80], op[:80]) == 1.0
    assert chance(np.full(N, 5.0), op) == 1.0
