"""n of a log-likelihood: samples that are not compared, and those at which PV starts anew, say nothing and count for
nothing.
"""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch.compete.pairing import Candidate, candidates_of, joint_scores
from app.engine.mismatch.compete.richer_noise import predictable
from app.engine.mismatch.compete.spikes import tail_penalty
from app.engine.mismatch.compete.worth import gain_under
from app.engine.mismatch.fit.closed_loop import modelled_noise
from app.engine.mismatch.fit.fitting import Fit, finish, fit_linear, task_of
from app.engine.mismatch.fit.noise import NoiseModel, compared_count, compared_samples, fit_noise, whiten
from app.engine.mismatch.fit.scan import Ground, gained, ground, scan, task_with
from app.engine.mismatch.fit.task import Given, start_at
from app.engine.mismatch.judge.adequacy import lack_of_fit
from app.engine.mismatch.judge.holdout import unseen_likelihood
from app.engine.mismatch.judge.residuals import residual_tests, white
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.loop.chain import simulate
from app.engine.mismatch.loop.experiment import Experiment, experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import valve_deadband
from app.engine.recording import BoolArray

N, KNOWN, TS = 1500, 450, 2.0
PLANT = Plant(K=1.4, tau=30.0, theta=6.0)
DEADBAND = valve_deadband.BLOCKS[0]


def recorded() -> Experiment:
    """A record of a valve with backlash, white noise on PV."""
    rng = np.random.default_rng(3)
    op = 40.0 + np.repeat(rng.uniform(-6.0, 6.0, N // 50), 50) + np.cumsum(rng.normal(size=N)) * 0.03
    plain = experiment(TS, op, op)
    pv = 50.0 + simulate(plain, PLANT, (Part(DEADBAND, np.array([2.0, 0.0])),))
    return experiment(TS, op, pv + 0.1 * rng.normal(size=N))


def twice_recorded() -> tuple[Fit, Fit]:
    """The linear refit of the beginning of a record, and the same one where samples follow that are not compared."""
    whole = recorded()
    found = fit_linear(whole.stretch(0, KNOWN), Given(PLANT))
    longer = whole.comparing(np.arange(N) < KNOWN)
    return found, replace(found, record=longer, simulated=simulate(longer, found.plant))


def with_backlash(found: Fit) -> Fit:
    task = task_with(found, DEADBAND)
    return finish(task, start_at(task, found.plant, np.array([2.0, 0.0])), found.noise)


def two_of_six(n: int = N) -> BoolArray:
    """PV known in two samples of six: the first of them starts anew after a gap of four."""
    return np.arange(n) % 6 < 2


def test_samples_that_are_not_compared_change_no_gain() -> None:
    short, longer = (ground(found, found.noise) for found in twice_recorded())
    assert short.count == longer.count == KNOWN - 3
    gains = [scan(DEADBAND, (under,))[0][0].gain for under in (short, longer)]
    assert gains[0] > 25.0
    assert gains[1] == pytest.approx(gains[0], rel=1e-3)
    couples = [joint_scores(pair_of(under), under)[0, 1] for under in (short, longer)]
    assert couples[1] == pytest.approx(couples[0], rel=1e-3)


def pair_of(under: Ground) -> list[Candidate]:
    starts = scan(DEADBAND, (under,))[0]
    return candidates_of(DEADBAND, (starts[0], starts[len(starts) // 2]), under)


def test_samples_that_are_not_compared_change_nothing_that_is_asked_of_a_fit() -> None:
    short, longer = twice_recorded()
    for asked in (lambda fit: sum(term.gain for term in lack_of_fit(fit)), predictable, tail_penalty):
        assert asked(longer) == pytest.approx(asked(short), rel=0.02, abs=1e-6)
    gains = [gain_under(with_backlash(found), found) for found in (short, longer)]
    assert gains[1] == pytest.approx(gains[0], rel=1e-3)


def test_the_priors_are_no_samples() -> None:
    under = ground(fit_linear(recorded(), Given(PLANT)), NoiseModel())
    assert len(under.rows) > N - 3
    assert gained(under, np.array([under.energy / np.e]))[0] == pytest.approx(0.5 * (N - 3))


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


def test_a_spike_is_far_from_the_innovations_there_are() -> None:
    """Most samples unknown, the median of all is zero, and every innovation is far from it."""
    record = recorded().comparing(two_of_six())
    found = fit_linear(record, Given(PLANT))
    assert np.mean(compared_samples(record.usable)) < 0.2
    assert tail_penalty(found) < 10.0
