"""Whether PV and OP have to do with each other: strangers pass for strangers, loops for loops, in any unit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.causality.coupling import strangers_chance, strangers_chance_finely
from app.engine.features import PER_CYCLE
from app.engine.oscillation import detect
from app.engine.recording import UniformRecord

N = 900


def chance(pv: np.ndarray, op: np.ndarray) -> float | None:
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
    assert chance(op[:119], op[:119]) is None
    assert chance(op[:120], op[:120]) is not None
    assert chance(np.full(N, 5.0), op) == 1.0


def test_a_quick_loop_under_a_load_of_days_goes_together_in_what_is_quick() -> None:
    """What the controller does about the load is done between two points of the load's own scale."""
    rng = np.random.default_rng(7)
    n = 20_000
    load = lfilter([1.0], [1.0, -0.9995], rng.normal(size=n))
    quick = 0.3 * rng.normal(size=n)
    op = -load + quick
    pv = lfilter([0.0, 0.5], [1.0, -0.5], quick) + 0.2 * rng.normal(size=n)
    slow = np.sin(2 * np.pi * np.arange(n) / 5000.0)
    loop = UniformRecord(1.0, pv + slow, op, None, np.zeros(n, bool))
    stranger = UniformRecord(1.0, rng.permutation(pv) + slow, op, None, np.zeros(n, bool))
    oscillation = detect(loop)
    assert oscillation.samples_per_cycle > 2000.0
    assert strangers_chance(loop, oscillation) > 1e-3
    assert strangers_chance_finely(loop, oscillation) < 1e-6
    assert strangers_chance_finely(stranger, oscillation) > 1e-2


def test_finer_than_the_samples_nothing_is_asked() -> None:
    rng = np.random.default_rng(8)
    op = wandering(rng, 0.9)
    loop = UniformRecord(1.0, lfilter([0.0, 0.5], [1.0, -0.5], op), op, None, np.zeros(N, bool))
    oscillation = replace(detect(loop), samples_per_cycle=float(PER_CYCLE))
    assert strangers_chance_finely(loop, oscillation) == 1.0
