"""Under feedback OP carries the noise: what two real poles and zeros lack of it is no answer of the process."""

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.mismatch import Comparison, explain, locate
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.compete.competition import contenders
from app.engine.mismatch.compete.richer_noise import noise_takes, taken_by_noise
from app.engine.mismatch.compete.worth import worth
from app.engine.mismatch.fit.fitting import LEAST_FURTHER, fit, further_lags
from app.engine.mismatch.fit.noise import NoiseModel, coloured, fit_noise, whiten
from app.engine.mismatch.fit.scan import task_with
from app.engine.mismatch.fit.task import start_at
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics import library
from tests.proof import long_clean

TS, N = 1.0, 4000
PROCESS = Plant(K=1.3, tau=13.0, theta=1.0)


@pytest.fixture(scope="module")
def clean() -> Comparison:
    """A PI loop at rest, its load with two complex poles, and the right simulation of it."""
    rng = np.random.default_rng(2)
    load = lfilter([1.0], [1.0, -2.0 * 0.93 * np.cos(0.13), 0.93**2], 0.15 * rng.normal(size=N))
    op, pv, stay, integral, level = np.zeros(N), np.zeros(N), np.exp(-TS / PROCESS.tau), 0.0, 0.0
    for t in range(N):
        pv[t] = level + 0.12 * rng.normal()
        integral -= pv[t] / 13.0
        op[t] = 1.5 * (integral - pv[t])
        level = stay * level + (1.0 - stay) * (PROCESS.K * (op[t - 1] if t else 0.0) + load[t])
    return Comparison("clean", TS, op, pv, np.zeros(N), trace=run_process(op, PROCESS, TS))


def test_what_the_noise_model_lacks_is_no_dead_time(clean: Comparison) -> None:
    base = prepare(clean).base
    blocks = tuple(block for block in library(base.record) if block.code == "process.dead_time")
    found = max(contenders(base, blocks), key=lambda contender: contender.gain)
    assert found.gain > found.block.penalty + 20.0
    assert taken_by_noise(found) > 0.8 * found.gain
    assert worth(found) < 0.0
    assert noise_takes(found.fit, base)


def test_what_a_long_record_shows_of_the_noise_is_no_inverse_response() -> None:
    """Of 40,000 samples 32 lags leave an inverse response 18 of 212 nat, more than it costs."""
    base = prepare(long_clean.case(1, 80_000, "two_poles", "rest").part(slice(0, 40_000))).base
    block = next(block for block in library(base.record) if block.code == "process.inverse_response")
    task = task_with(base, block)
    found = fit(task, start_at(task, base.plant, np.array([6.0, 3.0])), None, 3, 6)
    assert found.score > base.score + 100.0
    assert noise_takes(found, base)


def test_a_longer_record_is_asked_beside_more_lags() -> None:
    assert [further_lags(count) for count in (100, 4000, 40_000)] == [LEAST_FURTHER, LEAST_FURTHER, 68]


def test_a_clean_loop_under_such_a_load_is_consistent(clean: Comparison) -> None:
    said = explain(clean)
    assert (said.verdict, said.effects) == ("consistent", ())
    assert "parameters_off" not in [reason.code for reason in said.evidence]
    assert locate(clean).block is None


def test_an_autoregression_whitens_what_real_poles_do_not() -> None:
    e = np.random.default_rng(3).normal(size=N)
    r = lfilter([1.0], [1.0, -2.0 * 0.97 * np.cos(0.3), 0.97**2], e)
    every = np.ones(N, dtype=bool)
    poor, richer = fit_noise(r, every), fit_noise(r, every, further=LEAST_FURTHER)
    assert richer.deviation < 1.02 < 1.05 < poor.deviation
    assert np.std(whiten(r, every, richer)[LEAST_FURTHER:]) == pytest.approx(richer.deviation, rel=1e-2)


def test_coloured_undoes_whiten_with_an_autoregression_too() -> None:
    noise = NoiseModel((0.9, 0.3), (0.4, 0.0), 1.0, (0.5, -0.3))
    e = np.random.default_rng(4).normal(size=500)
    np.testing.assert_allclose(whiten(coloured(e, noise), np.ones(500, dtype=bool), noise), e, atol=1e-9)


def test_nothing_is_foretold_where_pv_is_unknown() -> None:
    noise = NoiseModel((0.9, 0.3), (0.4, 0.0), 1.0, (0.5, -0.3))
    known = np.ones(500, dtype=bool)
    known[100:120] = False
    e = whiten(np.random.default_rng(5).normal(size=500), known, noise)
    assert not e[100:121].any()
    assert e[121:].all()
