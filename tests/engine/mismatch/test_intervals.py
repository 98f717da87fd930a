"""How well a record tells a moment: its interval reaches as far as other moments explain the record nearly as well."""

from functools import partial

import numpy as np
import pytest

from app.engine.mismatch.fit.fitting import Fit, finish, fit, task_of
from app.engine.mismatch.fit.task import Given, make_task, start_at
from app.engine.mismatch.judge.intervals import deviations, interval, interval_tried
from app.engine.mismatch.judge.result import Estimate
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics import by_name
from tests.engine import open_loop

N, TS, SEEDS = 900, 2.0, range(12)
START_S, LASTING_S, SIZE = 700.0, 400.0, 1.2
PLANT = Plant(1.4, 30.0, 6.0)
moves = partial(open_loop.moves, N, 60)


def drifting(seed: int) -> Fit:
    """A sensor that drifts beside a linear plant, fitted from the truth under the noise of a seed."""
    time_s = TS * np.arange(N)
    drift = SIZE * np.clip((time_s - START_S) / LASTING_S, 0.0, 1.0)
    pv = 50.0 + run_process(moves(), PLANT, TS) + drift + open_loop.noise(N, seed)
    record = experiment(TS, 40.0 + moves(), pv, None, ())
    task = make_task(record, Given(PLANT), (by_name(record)["sensor.drift"],))
    return fit(task, start_at(task, PLANT, np.array([START_S, LASTING_S, SIZE])))


def held(estimates: list[Estimate], truth: float) -> int:
    return sum(estimate.low <= truth <= estimate.high for estimate in estimates)


@pytest.mark.parametrize(("name", "truth"), [("start", START_S), ("lasting", LASTING_S)])
def test_the_moments_of_a_drift_lie_in_their_intervals(name: str, truth: float) -> None:
    fits = [drifting(seed) for seed in SEEDS]
    by_slopes, tried = (
        [told(found, f"0.{name}", 0.0, "s", name, deviations(found)) for found in fits]
        for told in (interval, interval_tried)
    )
    assert held(by_slopes, truth) <= 9
    assert held(tried, truth) >= 11
    for narrow, wide in zip(by_slopes, tried, strict=True):
        assert wide.low <= narrow.low <= wide.value == narrow.value <= narrow.high <= wide.high


def test_an_interval_stays_within_what_a_number_may_be() -> None:
    found = drifting(0)
    duration = found.record.duration_s
    told = interval_tried(found, "0.start", 0.0, "s", "start", 1e3 * deviations(found))
    assert 0.0 <= told.low < told.value < told.high <= duration


@pytest.mark.parametrize("name", ["start", "lasting"])
def test_an_interval_does_not_hang_on_how_far_the_other_numbers_are_from_the_least_cost(name: str) -> None:
    """As they are after a fit by the free run alone: what they can regain speaks for no other moment."""
    found = drifting(0)
    spread = deviations(found)
    x = found.x + 6.0 * spread * np.array([free.name == "K" for free in found.free])
    settled = finish(task_of(found), x, found.noise)
    near, far = (interval_tried(one, f"0.{name}", 0.0, "s", name, spread) for one in (found, settled))
    assert far.high - far.low == pytest.approx(near.high - near.low, rel=0.2)


@pytest.mark.parametrize("off_s", [-0.02, 0.0, 0.02])
def test_a_jump_may_have_come_at_any_time_between_two_samples(off_s: float) -> None:
    jumped = np.where(np.arange(N) >= 400, SIZE, 0.0)
    pv = 50.0 + run_process(moves(), PLANT, TS) + jumped + open_loop.noise(N, 1)
    record = experiment(TS, 40.0 + moves(), pv, None, ())
    task = make_task(record, Given(PLANT), (by_name(record)["sensor.step"],))
    found = fit(task, start_at(task, PLANT, np.array([TS * 399 + off_s, SIZE])), None, 0)
    told = interval_tried(found, "0.start", 0.0, "s", "start", deviations(found))
    assert told.low <= TS * 399.01 < TS * 400.0 <= told.high
    assert told.high - told.low < 3.0 * TS
