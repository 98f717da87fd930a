"""A given model that integrates keeps both of its time constants."""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, LinearSimulation, explain
from app.engine.mismatch.compare.comparison import given_of, record_of
from app.engine.mismatch.loop.plant import run_process
from app.engine.recording import FloatArray
from tests.engine import open_loop

N, TS = 1500, 5.0
TAUS = (30.0, 20.0)


def moves() -> FloatArray:
    u = open_loop.moves(N, 50)
    return u - np.mean(u)


def comparison(taus: tuple[float, ...]) -> Comparison:
    """A level behind two lags, its simulation with some of them."""
    u, true = moves(), LinearSimulation(0.01, TAUS, integrating=True)
    record = record_of(Comparison("level", TS, 40.0 + u, u))
    pv = 50.0 + run_process(u, given_of(true, record).plant, TS) + 0.02 * open_loop.noise(N)
    return Comparison("level", TS, 40.0 + u, pv, simulation=LinearSimulation(0.01, taus, integrating=True))


@pytest.mark.parametrize("taus", [(), (30.0,), (30.0, 20.0), (20.0, 30.0)])
def test_the_time_constants_of_an_integrating_model_are_all_simulated(taus: tuple[float, ...]) -> None:
    """An answer to a step of OP that is as late as the sum of the lags, once they have passed."""
    u = np.where(np.arange(N) < 10, 0.0, 1.0)
    plant = given_of(LinearSimulation(0.01, taus, integrating=True), record_of(comparison(taus))).plant
    answer = run_process(u, plant, TS)
    late_s = np.arange(N)[-1] * TS - 10 * TS - answer[-1] / 0.01
    assert late_s == pytest.approx(sum(taus), abs=0.1)


def test_a_right_integrating_model_with_two_lags_lacks_nothing() -> None:
    said = explain(comparison(TAUS))
    assert said.effects == ()
    assert {"tau2", "tau3"} <= {estimate.name for estimate in said.refit}


def test_lags_of_an_integrating_model_that_are_off_are_fitted() -> None:
    said = explain(comparison((32.0, 19.0)))
    assert said.effects == ()
    told = {estimate.name: estimate for estimate in said.refit}
    assert told["tau2"].value + told["tau3"].value == pytest.approx(50.0, abs=2.0)
