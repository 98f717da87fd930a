"""n of a log-likelihood: samples that are not compared, and those at which PV starts anew, say nothing and count for
nothing.
"""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch.fit.closed_loop import modelled_noise
from app.engine.mismatch.fit.fitting import finish, fit_linear, task_of
from app.engine.mismatch.fit.noise import NoiseModel, compared_count, fit_noise, whiten
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.judge.holdout import unseen_likelihood
from app.engine.mismatch.judge.residuals import residual_tests, white
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.loop.chain import simulate
from app.engine.mismatch.loop.experiment import Experiment, experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import valve_deadband
from app.engine.recording import BoolArray

N, TS = 1500, 2.0
PLANT = Plant(K=1.4, tau=30.0, theta=6.0)
DEADBAND = valve_deadband.BLOCKS[0]


def recorded() -> Experiment:
    """A record of a valve with backlash, white noise on PV."""
    rng = np.random.default_rng(3)
    op = 40.0 + np.repeat(rng.uniform(-6.0, 6.0, N // 50), 50) + np.cumsum(rng.normal(size=N)) * 0.03
    plain = experiment(TS, op, op)
    pv = 50.0 + simulate(plain, PLANT, (Part(DEADBAND, np.array([2.0, 0.0])),))
    return experiment(TS, op, pv + 0.1 * rng.normal(size=N))


def two_of_six(n: int = N) -> BoolArray:
    """PV known in two samples of six: the first of them starts anew after a gap of four."""
    return np.arange(n) % 6 < 2


def test_the_deviation_of_noise_is_that_of_the_innovations_there_are() -> None:
    r = np.random.default_rng(1).normal(0.0, 0.3, 6000)
    known = two_of_six(6000)
    assert fit_noise(r, known).deviation == pytest.approx(0.3, rel=0.05)
    assert fit_noise(r, known, NoiseModel()).deviation == pytest.approx(0.3, rel=0.05)


def test_a_likelihood_counts_the_innovations_there_are() -> None:
    record = recorded().comparing(two_of_six())
    found = fit_linear(record, Given(PLANT))
    task = task_of(found)
    wide = replace(found.noise, deviation=np.e * found.noise.deviation)
    ratio = finish(task, found.x, found.noise).likelihood - finish(task, found.x, wide).likelihood
    # The first two samples of six fall into what is left out at the start.
    assert ratio == pytest.approx(compared_count(record.usable)) == pytest.approx(N // 6 - 1)
    held = record.usable & (np.arange(N) >= 900)
    unseen = [unseen_likelihood(replace(found, noise=noise), held) for noise in (found.noise, wide)]
    e = whiten(found.residual, record.usable, found.noise)[held] / found.noise.deviation
    energy = 0.5 * float(e @ e)
    assert unseen[0] - unseen[1] == pytest.approx(np.sum(held) // 2 - energy * (1.0 - np.exp(-2.0)))


def test_what_is_drawn_again_of_noise_are_the_innovations_there_are() -> None:
    found = fit_linear(recorded().comparing(two_of_six()), Given(PLANT))
    e = whiten(modelled_noise(found), np.ones(N, dtype=np.bool_), found.noise)
    assert np.std(e) == pytest.approx(found.noise.deviation, rel=0.1)


def test_whiteness_is_asked_of_the_innovations_there_are() -> None:
    r, known = np.random.default_rng(7).normal(size=N), np.arange(N) % 10 < 6
    held = known & (np.arange(N) > 500)
    e = np.where(held, whiten(r, known, fit_noise(r, known)), 0.0)
    found = residual_tests(r, recorded().op, known, held)
    assert found is not None
    assert found.whiteness.statistic == pytest.approx(white(e, np.flatnonzero(e != 0.0), 0.0).statistic)
