"""A given simulation that swings: its complex poles are found behind the trace and fitted, and accused of nothing."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain, simulate_again
from app.engine.mismatch.compare.comparison import given_of
from app.engine.mismatch.fit.bending import as_refitted
from app.engine.mismatch.fit.given import behind_trace
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.recording import FloatArray
from tests.engine import open_loop

N, TS = 1500, 2.0
SWINGING = Plant(1.4, 14.0, 6.0, damping=0.3)
GIVEN = Plant(1.45, 14.6, 6.0, damping=0.29)


def moves() -> FloatArray:
    u = open_loop.moves(N, 60)
    return u - u[0]


def asked(pv: FloatArray, given: Plant = GIVEN) -> Explanation:
    u = moves()
    return explain(Comparison("swing", TS, 40.0 + u, 50.0 + pv, trace=50.0 + run_process(u, given, TS)))


@cache
def asked_a_little_off() -> Explanation:
    return asked(run_process(moves(), SWINGING, TS) + open_loop.noise(N))


@pytest.mark.parametrize("behind_s", [(), (4.0,)])
@pytest.mark.parametrize("damping", [0.3, 1.0, 1.7])
def test_a_model_with_a_damping_runs_as_its_equation_does(damping: float, behind_s: tuple[float, ...]) -> None:
    u, model = moves(), LinearSimulation(1.4, (14.0, *behind_s), 6.0, damping=damping)
    run = run_process(u, given_of(model, experiment(TS, 40.0 + u, u)).plant, TS)
    expected = run_process(u, SWINGING.changed(damping=damping, tau3=sum(behind_s)), TS)
    # A lag behind a lag is straight from sample to sample, and this is three of them.
    np.testing.assert_allclose(run, expected, atol=1e-3 * np.ptp(expected) if behind_s else 1e-9)


def test_a_model_that_swings_is_told_as_its_trace_is() -> None:
    u, pv = moves(), run_process(moves(), SWINGING, TS) + open_loop.noise(N)
    model = LinearSimulation(GIVEN.K, (GIVEN.tau,), GIVEN.theta, damping=GIVEN.damping)
    said, by_trace = explain(Comparison("swing", TS, 40.0 + u, 50.0 + pv, simulation=model)), asked_a_little_off()
    assert said.effects == ()
    assert said.fit.given.rmse > 2.0 * said.fit.refitted.rmse
    assert said.fit.refitted.rmse == pytest.approx(by_trace.fit.refitted.rmse, rel=0.02)
    found = {estimate.name: estimate.value for estimate in said.refit}
    assert found["damping"] == pytest.approx(0.3, rel=0.05)


def test_a_record_shorter_than_the_lag_behind_what_swings_does_not_clear_it() -> None:
    u, slow = moves()[:400], Plant(20.0, 5.0, 6.0, damping=0.5, tau3=600.0)
    pv = run_process(u, slow, TS) + 0.05 * open_loop.noise(400)
    model = LinearSimulation(20.0, (5.0, 600.0), 6.0, damping=0.5)
    said = explain(Comparison("slow", TS, 40.0 + u, 50.0 + pv, simulation=model))
    assert (said.verdict, said.evidence[0].code) == ("inconclusive", "too_few_data")


def by_matrices(u: FloatArray, plant: Plant) -> FloatArray:
    """The linear law, its drive held over each sample; as scipy makes it discrete."""
    a = np.array([[0.0, 1.0], [-plant.leak / plant.tau**2, -2.0 * plant.damping / plant.tau]])
    b = np.array([[0.0], [plant.K / plant.tau**2]])
    a, b, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), TS)
    state, out = np.array([plant.x0, plant.speed0 / plant.tau]), np.zeros((N, 2))
    out[0] = state
    for t in range(1, N):
        state = a @ state + b[:, 0] * u[t - 1]
        out[t] = state
    return out @ np.array([1.0, -plant.zero])


@pytest.mark.parametrize("damping", [0.05, 0.3, 0.99, 1.0, 1.7])
@pytest.mark.parametrize(
    "changed", [{}, {"leak": 0.0}, {"leak": 0.1}, {"zero": 5.0}, {"tau": 1.0, "x0": 0.7}, {"x0": 0.4, "speed0": -0.9}]
)
def test_what_swings_is_exact_with_real_poles_and_complex_ones(damping: float, changed: dict[str, float]) -> None:
    plant, u = SWINGING.changed(theta=0.0, damping=damping, **changed), moves()
    expected = by_matrices(u, plant)
    np.testing.assert_allclose(run_process(u, plant, TS), expected, atol=1e-9 * np.max(np.abs(expected)))


def test_two_equal_lags_are_a_damping_of_one() -> None:
    u = moves()
    lags = run_process(u, Plant(1.4, 14.0, 6.0, tau2=14.0), TS)
    np.testing.assert_allclose(run_process(u, SWINGING.changed(damping=1.0), TS), lags, atol=1e-9)


def test_an_outflow_by_the_root_of_the_level_swings_by_its_equation() -> None:
    plant, u = SWINGING.changed(theta=0.0, head=4.0), 0.4 * moves()[:120] / np.max(np.abs(moves()))

    def rate(t: float, state: FloatArray) -> tuple[float, float]:
        x, speed = state
        pull = plant.K * u[int(t / TS)] - 8.0 * (np.sqrt(1.0 + x / 4.0) - 1.0)
        return speed, (pull - 2.0 * plant.damping * plant.tau * speed) / plant.tau**2

    at = TS * np.arange(119)
    exact = solve_ivp(rate, (0.0, at[-1]), (0.0, 0.0), t_eval=at, max_step=0.1).y[0]
    np.testing.assert_allclose(run_process(u, plant, TS)[:119], exact, atol=2e-3 * np.max(np.abs(exact)))


def test_what_swings_into_a_limit_rests_there_and_leaves_it_from_rest() -> None:
    u = np.where(np.arange(N) < 700, 1.0, -1.0)
    free, limited = (run_process(u, SWINGING.changed(high=high), TS) for high in (1e30, 1.2))
    assert np.max(free) > 1.6
    assert np.all(limited[40:700] == 1.2)
    assert np.all(np.diff(limited[704:715]) < 0.0)
    np.testing.assert_allclose(limited[-1], free[-1], atol=1e-9)


@pytest.mark.parametrize("damping", [0.15, 0.4, 0.7])
@pytest.mark.parametrize("tau", [3.0, 14.0, 120.0])
def test_complex_poles_are_found_behind_a_trace(tau: float, damping: float) -> None:
    u, plant = moves(), SWINGING.changed(tau=tau, damping=damping)
    behind = behind_trace(experiment(TS, 40.0 + u, u), 50.0 + run_process(u, plant, TS))
    found = behind.given.plant
    assert (found.K, found.tau, found.damping, found.theta) == pytest.approx((1.4, tau, damping, 6.0), rel=0.01)
    assert not np.any(behind.rest)


def test_complex_poles_are_found_behind_a_trace_that_begins_in_motion() -> None:
    u, plant = moves(), SWINGING.changed(damping=0.1, x0=3.0, speed0=-8.0)
    behind = behind_trace(experiment(TS, 40.0 + u, u), 50.0 + run_process(u, plant, TS))
    found = behind.given.plant
    assert (found.K, found.tau, found.damping, found.theta) == pytest.approx((1.4, 14.0, 0.1, 6.0), rel=0.01)
    assert not np.any(behind.rest)


@pytest.mark.parametrize("damping", [0.05, 0.1])
def test_a_swing_that_was_there_when_the_record_began_is_no_load(damping: float) -> None:
    """The simulation begins settled, as one that somebody starts does."""
    plant = SWINGING.changed(damping=damping)
    pv = run_process(moves(), plant.changed(x0=3.0, speed0=-8.0), TS)
    said = asked(pv + open_loop.noise(N), plant.changed(K=1.45, tau=14.6))
    assert said.effects == ()
    assert said.fit.refitted.rmse < 1.1 * np.std(open_loop.noise(N))
    np.testing.assert_allclose(simulate_again(said.model, 40.0 + moves()), said.traces.explained, atol=1e-9)


@pytest.mark.parametrize("factor", [0.5, 2.2])
def test_a_damping_further_off_is_no_missing_physics(factor: float) -> None:
    said = asked(run_process(moves(), SWINGING, TS) + open_loop.noise(N), GIVEN.changed(damping=0.3 * factor))
    assert said.effects == ()
    found = {estimate.name: estimate.value for estimate in said.refit}
    assert found["damping"] == pytest.approx(0.3, rel=0.1)
    off = next(reason.text for reason in said.evidence if reason.code == "parameters_off")
    assert f"damping {0.3 * factor:.4g} -> " in off


REAL = (Plant(1.4, 30.0, 6.0), Plant(1.4, 30.0, 6.0, tau2=12.0), Plant(0.02, 1.0, 6.0, leak=0.0))


@pytest.mark.parametrize("plant", REAL)
def test_real_poles_are_not_taken_for_complex_ones(plant: Plant) -> None:
    u = moves() - np.mean(moves())
    behind = behind_trace(experiment(TS, 40.0 + u, u), 50.0 + run_process(u, plant, TS))
    assert behind.given.plant.damping == 0.0


def test_a_swinging_simulation_whose_parameters_are_a_little_off_lacks_nothing() -> None:
    said = asked_a_little_off()
    assert said.effects == ()
    found = {estimate.name: estimate.value for estimate in said.refit}
    assert found["tau"] == pytest.approx(14.0, rel=0.03)
    assert found["damping"] == pytest.approx(0.3, rel=0.1)


def test_a_step_of_the_load_beside_a_swinging_simulation_is_a_step() -> None:
    load = np.where(np.arange(N) < 800, 0.0, 2.0)
    said = asked(run_process(moves() + load, SWINGING, TS) + open_loop.noise(N))
    assert [effect.code for effect in said.effects] == ["disturbance.step"]
    assert said.effects[0].windows[0].start_s == pytest.approx(1600.0, abs=30.0)
    assert said.fit.explained.rmse < 0.5 * said.fit.refitted.rmse


def test_a_further_lag_behind_a_swinging_simulation_is_a_lag_and_runs_again_from_its_model() -> None:
    said = asked(run_process(moves(), SWINGING.changed(tau3=9.0), TS) + open_loop.noise(N))
    assert "process.extra_lag" in (said.effects[0].code, *said.effects[0].alternatives)
    assert dict(said.model.plant)["damping"] > 0.0
    np.testing.assert_allclose(simulate_again(said.model, 40.0 + moves()), said.traces.explained, atol=1e-9)


def test_what_a_trace_holds_beside_what_swings_swings_as_the_plant_found_does() -> None:
    u = moves()
    was, now = (run_process(u, plant.changed(theta=6.0), TS) for plant in (GIVEN, SWINGING))
    bent = as_refitted(was, GIVEN, SWINGING, TS)
    assert np.std(bent - now) < 0.1 * np.std(was - now)
