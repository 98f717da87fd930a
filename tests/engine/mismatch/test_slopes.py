"""By how much the whitened residual moves with each number of a fit, and where of exact data nothing is left of it."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch.fit.fitting import descend, fit_linear, residual_rows, slopes
from app.engine.mismatch.fit.free_run import white_fit
from app.engine.mismatch.fit.noise import NoiseModel
from app.engine.mismatch.fit.task import Given, make_task, start_at
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics.valve_stiction import BLOCKS
from tests.engine.plain_loop import TRUE, TS, moves, recorded


@pytest.mark.parametrize("order", ["as they are", "backwards", "the block's between the plant's"])
def test_slopes_along_some_numbers_are_those_columns_in_their_order(order: str) -> None:
    rng = np.random.default_rng(0)
    op = 50.0 + 0.3 * np.cumsum(rng.normal(size=300))
    pv = 20.0 + np.convolve(op, np.exp(-np.arange(50) / 8.0) / 8.0)[:300]
    record, given = experiment(1.0, op, pv), Given(Plant(1.0, 8.0, 1.0))
    task, noise = make_task(record, given, BLOCKS[:1]), NoiseModel()
    values = BLOCKS[0].starts(Context(record, given.plant), pv)[30]
    x = start_at(task, given.plant, np.asarray(values))
    at, first = residual_rows(task, x, noise), task.linear_count
    asked = {
        "as they are": list(range(len(x))),
        "backwards": list(range(len(x)))[::-1],
        "the block's between the plant's": [0, first, 1, first + 1, 2],
    }[order]
    whole = slopes(task, x, noise, at)
    assert np.all(np.any(whole != 0.0, axis=0))
    np.testing.assert_array_equal(slopes(task, x, noise, at, asked), whole[:, asked])


@pytest.mark.filterwarnings("error")
def test_a_free_run_that_leaves_nothing_is_nearest_where_it_is() -> None:
    found = fit_linear(experiment(TS, 40.0 + moves(), recorded(moves())), Given(TRUE))
    exact = replace(found, record=replace(found.record, pv_deviation=found.simulated))
    assert white_fit(exact) == pytest.approx(exact.x, abs=0.05)


@pytest.mark.filterwarnings("error")
def test_slopes_whose_squares_are_no_numbers_lead_nowhere() -> None:
    record, given = experiment(TS, 40.0 + moves(), recorded(moves())), Given(TRUE)
    task = make_task(record, given, ())
    x = start_at(task, given.plant, np.zeros(0))
    assert np.array_equal(descend(task, x, NoiseModel(deviation=1e-157), 2), x)
