"""A measured feed of a vessel: what enters a process that integrates adds up there, as no lag of what is shown does."""

import numpy as np
import pytest
import scipy

from app.engine.mismatch import Comparison, LinearSimulation, explain, simulate_again
from app.engine.mismatch.judge.result import Explanation
from app.engine.recording import FloatArray

N, TS = 1500, 2.0
GAIN, ENTERS = 0.02, 0.004


def level(seed: int, feed: FloatArray) -> Comparison:
    """A level under PI control whose feed wanders, and beside it a signal that has nothing to do with it."""
    rng = np.random.default_rng(seed)
    sp = np.repeat(rng.uniform(-6.0, 6.0, N // 150), 150)
    load = scipy.signal.lfilter([0.04], [1.0, -0.9], rng.normal(size=N))
    arriving = scipy.signal.lfilter([0.2], [1.0, -0.8], feed)
    pv, op, x, summed = np.zeros(N), np.zeros(N), 0.0, 0.0
    for t in range(N):
        pv[t] = x + 0.05 * rng.normal()
        error = sp[t] - pv[t]
        summed += 0.02 * error
        op[t] = 2.0 * error + summed
        x += TS * (GAIN * (op[t - 1] if t else 0.0) + GAIN * load[t] + ENTERS * arriving[t])
    other = np.cumsum(rng.normal(size=N))
    return Comparison(
        "level", TS, 40.0 + op, 50.0 + pv, 50.0 + sp, (("feed", 20.0 + feed), ("other", other)),
        simulation=LinearSimulation(1.04 * GAIN, (), TS, integrating=True),
    )  # fmt: skip


def wandering(seed: int) -> FloatArray:
    signal: FloatArray = scipy.signal.lfilter([0.2], [1.0, -0.98], np.random.default_rng(seed).normal(size=N))
    return signal


@pytest.fixture(scope="module")
def told() -> Explanation:
    return explain(level(3, 3.0 * wandering(4)))


def test_the_feed_of_a_vessel_is_coupled_through_it(told: Explanation) -> None:
    first = told.effects[0]
    assert first.code == "disturbance.coupling"
    assert "feed" in first.condition
    gain = first.parameters[0]
    assert gain.unit == "PV/s/feed"
    assert gain.value == pytest.approx(ENTERS, rel=0.15)
    assert told.fit.explained.rmse < 0.3 * told.fit.refitted.rmse


def test_its_model_is_simulated_again(told: Explanation) -> None:
    comparison = level(3, 3.0 * wandering(4))
    again = simulate_again(told.model, comparison.op, comparison.measured)
    assert again == pytest.approx(told.traces.explained, abs=1e-6)


def test_a_feed_that_moves_nothing_is_not_coupled() -> None:
    loop = level(3, np.zeros(N))
    measured = (("feed", 20.0 + 3.0 * wandering(4)), *loop.measured[1:])
    said = explain(Comparison("level", TS, loop.op, loop.pv, loop.sp, measured, simulation=loop.simulation))
    assert "disturbance.coupling" not in [effect.code for effect in said.effects]
