"""A process that swings by itself: named with its poles, and none named where the poles are real."""

from functools import partial

import numpy as np
import pytest
from scipy.signal import cont2discrete

from app.engine.mismatch import Comparison, LinearSimulation, explain
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics.resonance import swinging, swinging_behind_a_lag
from app.engine.recording import FloatArray
from tests.engine import open_loop

N, TS, THETA = 1500, 2.0, 6.0
GIVEN = LinearSimulation(gain=1.45, time_constants_s=(28.5,), dead_time_s=THETA)
moves, noise = partial(open_loop.moves, N, 60), partial(open_loop.noise, N)


def second_order(u: FloatArray, natural_s: float, damping: float) -> FloatArray:
    """1 / (natural^2 s^2 + 2 damping natural s + 1) of u (N,), held over each sample."""
    a = np.array([[0.0, 1.0], [-1.0 / natural_s**2, -2.0 * damping / natural_s]])
    b = np.array([[0.0], [1.0 / natural_s**2]])
    a, b, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), TS)
    x, out = np.zeros(2), np.zeros(len(u))
    for t in range(1, len(u)):
        x = a @ x + b[:, 0] * u[t - 1]
        out[t] = x[0]
    return out


def late(u: FloatArray) -> FloatArray:
    whole = round(THETA / TS)
    return np.concatenate((np.full(whole, u[0]), u[:-whole]))


def test_the_simulation_is_that_of_the_differential_equation() -> None:
    u = np.random.default_rng(0).normal(size=N)
    context = Context(experiment(TS, u, u), Plant(K=1.0, tau=30.0, theta=0.0))
    simulated = run_process(u, swinging(context.plant, np.array([14.0, 0.3]), context), TS)
    np.testing.assert_allclose(simulated, second_order(u, 14.0, 0.3), atol=1e-9)


def test_complex_poles_are_named_and_found() -> None:
    u, natural_s, damping = moves(), 25.0, 0.3
    pv = 50.0 + 1.4 * second_order(late(u), natural_s, damping) + noise()
    answer = explain(Comparison("spring", TS, 40.0 + u, pv, simulation=GIVEN))
    assert [effect.code for effect in answer.effects] == ["process.resonance"]
    found = {p.name: p.value for p in answer.effects[0].parameters}
    assert found["natural"] == pytest.approx(natural_s, rel=0.05)
    assert found["damping"] == pytest.approx(damping, rel=0.15)
    assert answer.fit.explained.rmse < 0.6 * answer.fit.refitted.rmse


def test_the_poles_take_the_place_of_the_first_lag_or_of_both() -> None:
    u = np.random.default_rng(0).normal(size=N)
    context, poles = Context(experiment(TS, u, u), Plant(K=1.0, tau=30.0, theta=0.0, tau2=12.0)), np.array([14.0, 0.3])
    both = run_process(u, swinging(context.plant, poles, context), TS)
    np.testing.assert_allclose(both, second_order(u, 14.0, 0.3), atol=1e-9)
    assert swinging_behind_a_lag(context.plant, poles, context).tau3 == 12.0


@pytest.mark.parametrize("lags_s", [(33.5, 33.5), (50.0, 22.0)])
def test_a_process_that_swings_is_found_beside_two_lags(lags_s: tuple[float, float]) -> None:
    u = moves()
    pv = 50.0 + 1.4 * second_order(late(u), 33.5, 0.49) + 5.0 * noise()
    given = LinearSimulation(gain=1.45, time_constants_s=lags_s, dead_time_s=THETA)
    answer = explain(Comparison("spring", TS, 40.0 + u, pv, simulation=given))
    assert [effect.code for effect in answer.effects] == ["process.resonance"]
    found = {p.name: p.value for p in answer.effects[0].parameters}
    assert found["natural"] == pytest.approx(33.5, rel=0.05)
    assert found["damping"] == pytest.approx(0.49, rel=0.15)
    assert answer.fit.explained.rmse < 0.5 * answer.fit.refitted.rmse
    assert not any(reason.code == "parameters_off" for reason in answer.evidence)


@pytest.mark.parametrize("plant", [Plant(1.4, 30.0, 6.0), Plant(1.4, 30.0, 6.0, tau2=12.0), Plant(1.4, 30.0, 16.0)])
def test_real_poles_are_no_resonance(plant: Plant) -> None:
    u = moves()
    pv = 50.0 + run_process(u, plant, TS) + noise()
    answer = explain(Comparison("lags", TS, 40.0 + u, pv, simulation=GIVEN))
    assert not any("process.resonance" in (effect.code, *effect.alternatives) for effect in answer.effects)


@pytest.mark.parametrize("plant", [Plant(1.4, 20.0, 6.0, tau2=20.0), Plant(1.4, 30.0, 12.0, tau2=12.0)])
def test_two_lags_that_are_given_are_no_resonance(plant: Plant) -> None:
    u = moves()
    pv = 50.0 + run_process(u, plant, TS) + noise()
    given = LinearSimulation(gain=1.45, time_constants_s=(plant.tau, plant.tau2), dead_time_s=THETA)
    answer = explain(Comparison("lags", TS, 40.0 + u, pv, simulation=given))
    assert not any("process.resonance" in (effect.code, *effect.alternatives) for effect in answer.effects)


def test_poles_that_are_complex_but_do_not_swing_are_one_lag_more() -> None:
    u = moves()
    pv = 50.0 + 1.4 * second_order(late(u), 25.0, 0.85) + noise()
    answer = explain(Comparison("lags", TS, 40.0 + u, pv, simulation=GIVEN))
    assert [effect.code for effect in answer.effects] == ["process.extra_lag"]
    assert "process.resonance" not in answer.effects[0].alternatives
