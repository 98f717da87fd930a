"""A wave that lasts for many turns: its period is found to a share of a turn over all of them."""

from functools import cache, partial

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.fit.fitting import residual_rows, slopes
from app.engine.mismatch.fit.noise import NoiseModel
from app.engine.mismatch.fit.task import Given, make_task, start_at
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics import by_name
from tests.engine import open_loop

N, TS = 2400, 1.0
moves, noise = partial(open_loop.moves, N, 120), partial(open_loop.noise, N)
PLANT = Plant(1.4, 30.0, 6.0)
GIVEN = LinearSimulation(gain=1.45, time_constants_s=(28.5,), dead_time_s=6.0)


@cache
def shaken(period_s: float, begin: int, end: int, size: float) -> Explanation:
    """What is said of a wave on PV from one sample up to another."""
    time_s, lasting = TS * np.arange(N), slice(begin, end)
    wave = np.zeros(N)
    wave[lasting] = size * np.sin(2.0 * np.pi * time_s[lasting] / period_s)
    pv = 50.0 + run_process(moves(), PLANT, TS) + wave + noise()
    return explain(Comparison("shaken", TS, 40.0 + moves(), pv, simulation=GIVEN))


@pytest.mark.parametrize(("period_s", "begin", "end"), [(33.28, 240, 2000), (57.77, 300, 1900)])
def test_a_long_wave_is_found_as_one_sine(period_s: float, begin: int, end: int) -> None:
    answer = shaken(period_s, begin, end, 1.5)
    (effect,) = answer.effects
    assert effect.code == "disturbance.oscillation"
    assert [p.name for p in effect.parameters] == ["start", "end", "period", "sine", "cosine"]
    found = {p.name: p for p in effect.parameters}
    assert found["period"].value == pytest.approx(period_s, rel=5e-4)
    assert found["start"].value == pytest.approx(TS * begin, abs=0.25 * period_s)
    assert found["end"].value == pytest.approx(TS * end, abs=0.25 * period_s)
    assert found["period"].low <= period_s <= found["period"].high
    assert answer.fit.explained.rmse < 1.1 * float(np.std(noise()))


@pytest.mark.parametrize(
    ("period_s", "begin", "end", "size"), [(150.0, 600, 1080, 1.5), (120.0, 900, 1300, 1.2), (33.28, 240, 2000, 1.5)]
)
def test_the_ends_of_a_wave_are_found(period_s: float, begin: int, end: int, size: float) -> None:
    """Each turn and each sample has a valley of its own: from a wrong one a step made good what the ends were off."""
    answer = shaken(period_s, begin, end, size)
    assert [effect.code for effect in answer.effects] == ["disturbance.oscillation"]
    found = {p.name: p for p in answer.effects[0].parameters}
    assert found["start"].value == pytest.approx(TS * begin, abs=0.02 * period_s)
    assert found["end"].value == pytest.approx(TS * end, abs=0.02 * period_s)


@pytest.mark.parametrize("name", ["disturbance.oscillation", "disturbance.oscillation/shaped"])
def test_the_slope_of_the_period_is_right_over_thousands_of_turns(name: str) -> None:
    """d/d ln(period) of sin(2 pi t / period) is -2 pi t / period cos(2 pi t / period)."""
    n, period_s = 8000, 2.83
    phase = 2.0 * np.pi * np.arange(n) / period_s
    pv = np.random.default_rng(0).normal(size=n)
    record = experiment(TS, np.repeat([40.0, 44.0], n // 2), pv, None, ())
    task = make_task(record, Given(PLANT), (by_name(record)[name],))
    count = len(task.free) - task.linear_count
    x = start_at(task, PLANT, np.array([0.0, n * TS, period_s, 1.0, *np.zeros(count - 4)]))
    white, at = NoiseModel(deviation=1.0), task.linear_count + 2
    slope = slopes(task, x, white, residual_rows(task, x, white), [at])[: -len(x), 0]
    exact = (phase * np.cos(phase))[-len(slope) :]
    assert task.free[at].name == "0.period"
    assert np.linalg.norm(slope - exact) < 0.02 * np.linalg.norm(exact)
