"""What the forms of the library do to a signal, against their equations: loads, integrating plants, near names."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, LinearSimulation, explain
from app.engine.mismatch.compete.competition import Contender, Scanned, promising
from app.engine.mismatch.compete.naming import believed
from app.engine.mismatch.fit.fitting import Fit, fit_linear, orthonormal, projected_cost
from app.engine.mismatch.fit.given import behind_trace
from app.engine.mismatch.fit.scan import at_given
from app.engine.mismatch.fit.task import START_DEVIATION, Given, make_task, start_deviation
from app.engine.mismatch.judge.holdout import kept_out
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.chain import simulate
from app.engine.mismatch.loop.experiment import Experiment, experiment
from app.engine.mismatch.loop.plant import Plant, lag, run_process
from app.engine.mismatch.physics import by_name, two_tanks
from app.engine.mismatch.physics import vessel as vessels
from app.engine.mismatch.physics.scales import LEAST_DEPTH
from app.engine.mismatch.physics.vessel import balance_beside
from app.engine.recording import FloatArray

N, TS = 600, 2.0
PLANT = Plant(K=1.4, tau=30.0, theta=6.0)
INTEGRATING = Plant(K=0.02, tau=1.0, theta=6.0, tau2=8.0, leak=0.0)


def moves(seed: int = 1) -> FloatArray:
    """OP as deviation: steps that hold for a while."""
    return np.repeat(np.random.default_rng(seed).uniform(-6.0, 6.0, N // 30), 30)


def record_of(pv: FloatArray) -> Experiment:
    return experiment(TS, 40.0 + moves(), pv)


RECORD = record_of(50.0 + run_process(moves(), PLANT, TS))


def part(name: str, *values: float) -> Part:
    return Part(by_name(RECORD)[name], np.array(values))


def test_a_load_enters_the_process_without_the_dead_time_of_op() -> None:
    added = simulate(RECORD, PLANT, (part("disturbance.step", 400.0, 3.0),)) - simulate(RECORD, PLANT)
    later = np.maximum(RECORD.time_s - 402.0, 0.0)  # the ramp of one sample into the step is over
    assert added[RECORD.time_s <= 400.0] == pytest.approx(0.0, abs=1e-12)
    assert added == pytest.approx(3.0 * (1.0 - np.exp(-later / PLANT.tau)), abs=3.0 * TS / PLANT.tau)
    assert added[-1] == pytest.approx(3.0, abs=1e-3)


def test_a_load_passes_what_else_the_process_lacks() -> None:
    step, more = part("disturbance.step", 400.0, 3.0), part("process.extra_lag", 40.0)
    added = simulate(RECORD, PLANT, (step, more)) - simulate(RECORD, PLANT, (more,))
    alone = simulate(RECORD, PLANT, (step,)) - simulate(RECORD, PLANT)
    assert added == pytest.approx(lag(alone, 40.0, TS), abs=1e-9)
    later = part("process.dead_time", 20.0)
    early = simulate(RECORD, PLANT, (step, later)) - simulate(RECORD, PLANT, (later,))
    assert early == pytest.approx(alone, abs=1e-9)


def test_a_load_on_a_full_vessel_runs_over() -> None:
    full = part("process.overflow/high", -20.0)
    both = simulate(RECORD, PLANT, (full, part("disturbance.step", 400.0, 3.0)))
    assert both == pytest.approx(simulate(RECORD, PLANT, (full,)), abs=1e-12)


def test_a_load_on_an_integrator_moves_it_by_its_size_in_a_tenth_of_the_record() -> None:
    added = simulate(RECORD, INTEGRATING, (part("disturbance.step", 400.0, 3.0),)) - simulate(RECORD, INTEGRATING)
    since = RECORD.time_s - 402.0 - INTEGRATING.tau2
    assert added[-1] == pytest.approx(30.0 * since[-1] / RECORD.duration_s, rel=1e-3)


def test_an_integrator_behind_an_actuator_answers_a_step_as_its_equation_does() -> None:
    v = np.ones(N)
    v[0] = 0.0
    y = run_process(v, INTEGRATING.changed(theta=0.0), TS)
    t = np.maximum(np.arange(N) * TS - TS, 0.0)
    tau = INTEGRATING.tau2
    assert y == pytest.approx(INTEGRATING.K * (t - tau * (1.0 - np.exp(-t / tau))), abs=1e-9)


def test_a_process_that_integrates_is_not_asked_whether_it_does() -> None:
    for name in ("process.integrating", "process.integrating/leaky"):
        suits = by_name(RECORD)[name].suits
        assert suits is not None
        assert suits(Context(RECORD, PLANT))
        assert not suits(Context(RECORD, INTEGRATING))


def test_a_level_behind_an_actuator_stops_sharply_at_the_brim() -> None:
    y = run_process(np.ones(N), INTEGRATING.changed(high=2.0), TS)
    assert np.max(y) == 2.0
    assert np.all(y[np.argmax(y) :] == 2.0)


@pytest.mark.parametrize("plant", [INTEGRATING, PLANT])
def test_the_lags_of_a_trace_are_not_taken_for_dead_time(plant: Plant) -> None:
    trace = run_process(RECORD.op_deviation, plant, TS)
    pv = 50.0 + 3.0 * np.sin(RECORD.time_s / 40.0)  # the loop holds PV where the open trace walks away
    given = behind_trace(record_of(pv), trace).given
    assert given.integrating == (plant.leak == 0.0)
    assert given.plant.tau2 == pytest.approx(plant.tau2, rel=0.02)
    assert given.plant.theta == pytest.approx(plant.theta, abs=0.1 * TS)


def test_the_first_samples_of_a_noisy_pv_do_not_fix_where_it_started() -> None:
    quiet = run_process(RECORD.op_deviation, PLANT, TS)
    noisy = quiet + np.random.default_rng(2).normal(size=N) * np.ptp(quiet)
    prompt = PLANT.changed(theta=0.0, tau2=0.0)
    assert start_deviation(record_of(50.0 + quiet), prompt) == START_DEVIATION
    assert start_deviation(record_of(50.0 + quiet), PLANT.changed(theta=PLANT.tau)) > 2.0 * START_DEVIATION
    record = record_of(50.0 + noisy)
    assert start_deviation(record, prompt) == pytest.approx(np.ptp(quiet) / np.sqrt(3.0) / record.pv_span, rel=0.1)
    free = next(f for f in make_task(record, Given(PLANT), ()).free if f.name == "x0")
    assert free.deviation == start_deviation(record, PLANT)


def test_a_block_far_from_any_linear_loop_is_fitted_whatever_its_scan_says() -> None:
    base = fit_linear(RECORD, Given(PLANT))
    blocks = by_name(RECORD)
    dull = tuple(Scanned(blocks[name], (), 0.1, 0.1) for name in ("process.overflow/high", "process.dead_time"))
    assert [scanned.block.name for scanned in promising(dull, base)] == ["process.overflow/high"]


@pytest.mark.parametrize(("share", "said"), [(0.9, ("process.friction",)), (0.8, ())])
def test_dry_friction_is_said_beside_a_deadband_that_explains_hardly_more(
    share: float, said: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(5)
    record = record_of(RECORD.pv + 0.3 * rng.normal(size=N))
    base = fit_linear(record, Given(PLANT.changed(tau2=10.0), second_order=True))
    monkeypatch.setattr(Fit, "beside_richer_noise", property(lambda fit: fit))  # made-up fits cannot be fitted again
    best, other = (
        Contender(replace(base, likelihood=base.likelihood + gain, parts=(Part(block, values),)), base)
        for block, values, gain in (
            (by_name(record)["valve.deadband"], np.array([1.0]), 115.0),
            (by_name(record)["process.friction"], np.array([1.0, 0.0]), 19.0 + 100.0 * share),
        )
    )
    assert believed(best, (best, other)).alternatives == said


def vessel(seed: int = 3) -> tuple[FloatArray, FloatArray]:
    """OP and PV as deviations of an integrating vessel under a controller that asks for more than it holds for a
    third of the record; OP winds up meanwhile, and its mean is far from the OP that holds the level.
    """
    rng = np.random.default_rng(seed)
    op, pv = np.zeros(N), np.zeros(N)
    level, summed, load = 0.0, 0.0, 0.0
    asked = np.where((np.arange(N) > 150) & (np.arange(N) < 350), 6.0, 4.0 * np.sign(np.sin(np.arange(N) / 30.0)))
    for t in range(N):
        pv[t] = level + 0.1 * rng.normal()
        summed += 0.01 * (asked[t] - pv[t])
        op[t] = 1.5 * (asked[t] - pv[t]) + summed
        load = 0.9 * load + 0.01 * rng.normal()
        level = min(level + TS * (INTEGRATING.K * op[max(t - 3, 0)] + load), 3.0)
    return op, pv


def test_the_op_that_holds_a_level_is_read_off_where_it_is_clear_of_the_brim() -> None:
    op, pv = vessel()
    record = experiment(TS, op, pv)
    context = Context(record, INTEGRATING.changed(tau2=0.0))
    held = INTEGRATING.K * record.op_mid
    assert balance_beside(context, 1.0, 3.0 - record.pv_mid) == pytest.approx(held, rel=0.1)
    assert held > 0.5 * INTEGRATING.K * np.std(op)  # the mean of OP is far from what holds the level


def test_blocks_far_from_linear_begin_at_the_given_parameters_too() -> None:
    op, pv = vessel()
    record = experiment(TS, op, pv)
    given = INTEGRATING.changed(tau2=0.0)
    base = fit_linear(record, Given(given, integrating=True))
    starts = at_given(by_name(record)["process.overflow/high"], base)
    assert {(start.plant.K, start.plant.theta) for start in starts if start.plant} == {(given.K, given.theta)}
    assert [start.gain for start in starts] == sorted((start.gain for start in starts), reverse=True)
    assert starts[0].values[0] == pytest.approx(3.0 - record.pv_mid, abs=0.3)
    assert -starts[0].gain < 0.2 * np.std(base.residual)


def test_a_vessel_that_ran_over_is_not_called_a_valve() -> None:
    op, pv = vessel()
    said = explain(Comparison("vessel", TS, op, pv, simulation=LinearSimulation(0.021, (), 6.0, integrating=True)))
    assert {"process.overflow"} & {said.effects[0].code, *said.effects[0].alternatives}
    limit = next(p for p in said.effects[0].parameters if p.name == "limit")
    assert limit.value == pytest.approx(3.0, abs=0.2)


def test_what_is_kept_out_is_a_share_of_what_can_be_compared() -> None:
    usable = np.arange(N) < 0.2 * N
    held = kept_out(fit_linear(RECORD, Given(PLANT)), usable)
    assert not np.any(held & ~usable)
    assert np.sum(held) == pytest.approx(0.3 * np.sum(usable), abs=1)


def test_a_vessel_has_a_depth_where_pv_stays_above_the_working_point() -> None:
    above = replace(RECORD, pv_deviation=RECORD.pv_deviation - np.min(RECORD.pv_deviation) + 1.0)
    for record, least in ((RECORD, float(-np.min(RECORD.pv_deviation))), (above, LEAST_DEPTH * above.pv_span)):
        context = Context(record, replace(PLANT, tau2=8.0))
        for block in (*vessels.BLOCKS, *two_tanks.BLOCKS):
            heads = [place for place, known in enumerate(block.parameters(context)) if "head" in known.name]
            assert all(block.parameters(context)[place].low > 0.0 for place in heads)
            if heads:
                assert np.min(block.starts(context, record.pv_deviation)[:, heads]) >= 0.9 * least


def test_the_directions_of_a_fit_leave_out_what_ran_away() -> None:
    columns = np.random.default_rng(1).normal(size=(50, 3))
    wild = np.column_stack((columns[:, 0], np.full(50, np.inf), columns[:, 1:], np.full(50, np.nan)))
    np.testing.assert_allclose(np.abs(orthonormal(wild)), np.abs(orthonormal(columns)))
    assert orthonormal(wild[:, [1, 4]]).shape == (50, 0)


def test_a_simulation_that_ran_away_costs_no_less_than_any_other() -> None:
    rows = np.full(50, 1e200)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not projected_cost(rows, orthonormal(np.ones((50, 1)))) < np.finfo(float).max
