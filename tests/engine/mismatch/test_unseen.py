"""What is said of names where the stretch that no fit has seen speaks against them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.mismatch import Comparison
from app.engine.mismatch.compare.comparison import given_of, record_of
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.fit.fitting import Fit, fit_linear
from app.engine.mismatch.fit.given import identify
from app.engine.mismatch.fit.refitting import PARAMETERS, freed
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.free_runs import given_run
from app.engine.mismatch.judge.conclude import held_out_worse
from app.engine.mismatch.judge.holdout import FitMeasures, Unseen, judge, refit_without, stretches
from app.engine.mismatch.judge.result import Effect, Improvement
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.loop.experiment import Experiment, experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.report import refit_estimates
from app.engine.recording import BoolArray, FloatArray
from tests.engine import open_loop
from tests.engine.plain_loop import GIVEN, TRUE, TS, N, moves, noise, recorded

NAMED = Effect("valve.deadband", ("valve.stiction",), 0.9, "valve", (), (), "after OP reversals", (), 40.0)


def improved(refitted: float, explained: float) -> Improvement:
    return Improvement(None, FitMeasures(refitted, 0.0), FitMeasures(explained, 0.0), ())


@pytest.mark.parametrize(
    ("error", "beside_load", "gain", "ran_worse", "why"),
    [
        (1.2, 1.2, -1.0, [True, False, True, False, False], "2 of 5 stretches"),
        (1.2, 0.25, -1.0, [False], "is 0.25 there, and 1 without"),
        (1.2, 1.2, 7.0, [False], "better, by 7.0 points of log-likelihood"),
        (1.02, 1.02, -1.0, [False], "noise"),
    ],
)
def test_names_that_stand_beside_a_worse_free_run_say_so(
    error: float, beside_load: float, gain: float, ran_worse: list[bool], why: str
) -> None:
    (said,) = held_out_worse(
        (NAMED,), improved(1.0, error), Unseen(1.0, beside_load, beside_load < 1.0), gain, ran_worse
    )
    assert said.code == "held_out_worse"
    assert f"from 1 to {error:.4g}" in said.text
    assert "valve.deadband or valve.stiction" in said.text
    assert why in said.text


@pytest.mark.parametrize(("effects", "error"), [((NAMED,), 0.9), ((NAMED,), float("nan")), ((), 1.2)])
def test_nothing_is_said_where_nothing_is_worse_or_named(effects: tuple[Effect, ...], error: float) -> None:
    assert held_out_worse(effects, improved(1.0, error), Unseen(1.0, error), 1.0, [False]) == ()


@pytest.mark.parametrize("level", [0.0, 50.1, 1000.3])
def test_a_pv_that_stands_has_no_fit(level: float) -> None:
    """The deviation of equal values from their mean is rounding: a hundred million million per cent of it is no fit."""
    pv = np.full(450, level)
    found = judge(pv, pv + 0.01, np.ones(450, dtype=np.bool_))
    assert found.rmse == pytest.approx(0.01)
    assert np.isnan(found.fit_pct)


PART = Part(PARAMETERS, np.array([1.0, 1.0, 1.0]))


def found_off(record: Experiment, gain: float) -> Fit:
    """A fit in which a given simulation turned out to have this gain."""
    plant = TRUE.changed(K=gain)
    return replace(fit_linear(record, Given(plant)), plant=plant)


def wandering(seed: int, later: float = 0.0) -> Comparison:
    """A loop under slow noise, whose last 30 % stand higher."""
    rng = np.random.default_rng(seed)
    slow = lfilter([0.15], [1.0, -0.995], rng.normal(size=N))
    pv = recorded(moves(), slow - noise()) + later * (np.arange(N) >= 0.7 * N)
    return Comparison("wandering", TS, 40.0 + moves(), pv, simulation=GIVEN)


@pytest.mark.parametrize("seed", [2, 3])
def test_a_refit_owes_nothing_to_the_samples_held_out(seed: int) -> None:
    """Under slow noise a descent that began at the fit of all samples gained nothing, and stayed there."""
    gains = []
    for later in (0.0, 4.0):
        record = record_of(wandering(seed, later))
        found = fit_linear(record, given_of(GIVEN, record))
        held = stretches(record.usable)[0]
        gains.append(refit_without(found, held).plant.K)
    assert gains[0] == pytest.approx(gains[1], rel=5e-3)


def kept_out(op: FloatArray, pv: FloatArray) -> tuple[Experiment, BoolArray]:
    record = experiment(TS, op, pv)
    return record, stretches(record.usable)[0]


@pytest.mark.parametrize("seed", [0, 4])
def test_our_own_loop_owes_nothing_to_the_samples_held_out(seed: int) -> None:
    """What it begins with is a fit of all of PV, and was what it is held to as well."""
    u, numbers = 0.4 * open_loop.moves(600, 60, seed), []
    slow = lfilter([0.1], [1.0, -0.97], np.random.default_rng(seed).normal(size=600))
    other = lfilter([0.3], [1.0, -0.97], np.random.default_rng(99 + seed).normal(size=600)) * (np.arange(600) >= 420)
    for later in (0.0, 1.0):
        pv = 50.0 + run_process(u, Plant(K=0.8, tau=12.0, theta=4.0), TS) + slow + later * other
        record, held = kept_out(40.0 + u, pv)
        plant = refit_without(identify(record), held).plant
        numbers.append((plant.K, plant.tau))
    assert numbers[0] == pytest.approx(numbers[1], rel=5e-3)


def test_parameters_that_were_found_in_all_samples_owe_nothing_to_those_held_out() -> None:
    """As where a given simulation was three times off: what was found is held to no closer than the factor was."""
    record, held = kept_out(40.0 + moves(), recorded(moves()))
    gains = []
    for gain in (1.4, 1.7):
        given = freed(found_off(record, gain), PART)
        gains.append(refit_without(fit_linear(record, given), held).plant.K)
    assert gains[0] == pytest.approx(gains[1], rel=2e-3)


def test_an_interval_of_parameters_that_were_found_is_no_narrower_than_what_the_record_tells() -> None:
    record, _ = kept_out(40.0 + moves(), recorded(moves(), 4.0 * lfilter([1.0], [1.0, -0.97], noise(5))))
    given = freed(found_off(record, 1.4), PART)
    told, known = (refit_estimates(fit_linear(record, g))[0] for g in (given, replace(given, deviation=0.05)))
    assert told.high - told.low > 1.5 * (known.high - known.low)


def test_our_own_loop_is_made_of_the_samples_that_are_compared() -> None:
    u, bad = moves(), slice(200, 700)
    pv = recorded(u)
    bridged = pv.copy()
    bridged[bad] = np.linspace(pv[200], pv[700] + 20.0, 500)
    usable = np.ones(N, dtype=np.bool_)
    usable[bad] = False
    record, _ = kept_out(40.0 + u, bridged)
    plant = identify(record.comparing(usable)).given.plant
    assert (plant.K, plant.tau) == pytest.approx((TRUE.K, TRUE.tau), rel=0.1)


def test_a_given_model_stands_at_the_level_of_the_samples_not_held_out() -> None:
    comparison = wandering(1, later=5.0)
    prepared = prepare(comparison)
    held = stretches(prepared.record.usable)[0]
    run = given_run(comparison, prepared, held)
    assert run is not None
    left = comparison.pv - run
    assert np.mean(left[prepared.record.usable & ~held]) == pytest.approx(0.0, abs=1e-9)
    assert np.mean(left[held]) > 3.0
