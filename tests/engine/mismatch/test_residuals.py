"""Whether what a free run leaves is white, and whether it owes anything to OP."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import chdtri

from app.engine.mismatch import Comparison, LinearSimulation, explain
from app.engine.mismatch.judge.residuals import residual_tests
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.recording import BoolArray, FloatArray
from app.services.explaining.line import tests_line as line_of

N = 2000
EVERYWHERE = np.ones(N, dtype=np.bool_)
DRAWS = 60
ALONG = np.arange(N, dtype=np.float64)


def held() -> BoolArray:
    return np.arange(N) >= 1400


def loads(rng: np.random.Generator) -> FloatArray:
    """A load behind a lag, under white noise."""
    return lfilter([1.0, -0.5], [1.0, -0.95], rng.normal(size=N))


def moves(rng: np.random.Generator) -> FloatArray:
    return 40.0 + lfilter([0.1], [1.0, -0.9], np.cumsum(rng.normal(size=N)))


@pytest.mark.parametrize("late", [0, 30])
def test_what_chance_leaves_passes_as_often_as_is_claimed(late: int) -> None:
    rng = np.random.default_rng(5)
    failed = np.zeros(2)
    for _ in range(DRAWS):
        tests = residual_tests(loads(rng), moves(rng), EVERYWHERE, held(), late)
        failed += (not tests.whiteness.passed, not tests.independence.passed)
    assert np.all(failed <= 0.05 * DRAWS + 4.0)


def test_what_the_noise_model_takes_is_taken_off_the_degrees_of_freedom() -> None:
    rng = np.random.default_rng(4)
    residual, op = loads(rng), moves(rng)
    tests = residual_tests(residual, op, EVERYWHERE, held())
    assert tests.whiteness.limit == pytest.approx(chdtri(20.0 - 2.0 * 0.3, 0.05))
    assert residual_tests(residual, op, held(), held()).whiteness.limit == pytest.approx(chdtri(18.0, 0.05))
    assert tests.independence.limit == pytest.approx(chdtri(20.0, 0.05))


def test_noise_alone_is_white_in_nineteen_records_of_twenty() -> None:
    drawn = (np.random.default_rng(seed) for seed in range(600))
    found = [residual_tests(loads(rng), ALONG, EVERYWHERE, held()).whiteness.p_value for rng in drawn]
    assert np.mean(np.array(found) < 0.1) == pytest.approx(0.1, abs=0.02)
    assert np.mean(np.array(found) < 0.5) == pytest.approx(0.5, abs=0.04)


def test_what_op_still_explains_is_seen_within_the_lags_that_are_asked() -> None:
    rng = np.random.default_rng(6)
    op = np.repeat(rng.uniform(-6.0, 6.0, N // 50), 50)
    noise, answer = 0.5 * loads(rng), lfilter([0.1], [1.0, -0.9], op)
    late = np.concatenate((np.zeros(25), answer[:-25]))
    assert residual_tests(noise, op, EVERYWHERE, held(), 30).independence.p_value > 0.01
    tests = residual_tests(noise + late, op, EVERYWHERE, held(), 30)
    assert tests.independence.p_value < 0.001
    assert tests.independence.lags == 50


def test_an_oscillation_that_no_noise_model_holds_is_not_white() -> None:
    rng = np.random.default_rng(7)
    wave = 2.0 * np.sin(2.0 * np.pi * np.arange(N) / 14.0)
    tests = residual_tests(loads(rng) + wave, moves(rng), EVERYWHERE, held())
    assert tests.whiteness.p_value < 0.001


def test_op_that_answers_pv_is_not_accused() -> None:
    """Under feedback OP carries the noise that came before it; only what comes after OP is asked."""
    rng = np.random.default_rng(8)
    failed = 0
    for _ in range(DRAWS):
        noise = loads(rng)
        op = 40.0 - lfilter([0.8, -0.75], [1.0, -1.0], noise)
        failed += not residual_tests(noise, op, EVERYWHERE, held()).independence.passed
    assert failed <= 0.05 * DRAWS + 4.0


def test_samples_that_are_not_compared_say_nothing() -> None:
    rng = np.random.default_rng(9)
    residual, op = loads(rng), moves(rng)
    usable = EVERYWHERE.copy()
    usable[1500:1540] = False
    wild = np.where(usable, residual, 1e6)
    tests = residual_tests(wild, op, usable, held() & usable)
    assert tests.whiteness.p_value > 0.001
    assert tests.independence.p_value > 0.001


@pytest.mark.parametrize(
    ("residual", "stretch"),
    [
        (np.zeros(N), held()),
        (loads(np.random.default_rng(1)), np.arange(N) > N - 90),
        (loads(np.random.default_rng(1)), np.zeros(N, dtype=np.bool_)),
    ],
    ids=["nothing left", "too short", "nothing kept out"],
)
def test_where_it_cannot_be_told_nothing_is_said(residual: FloatArray, stretch: BoolArray) -> None:
    assert residual_tests(residual, moves(np.random.default_rng(2)), EVERYWHERE, stretch) is None


def test_without_moves_of_op_only_whiteness_is_asked() -> None:
    tests = residual_tests(loads(np.random.default_rng(1)), np.full(N, 40.0), EVERYWHERE, held())
    assert tests.whiteness is not None
    assert tests.independence is None


def bumped(last: int) -> FloatArray:
    """OP of a bump test, its last step at a sample before the stretch kept out."""
    op = np.full(N, 40.0)
    op[300:700], op[700:last] = 45.0, 36.0
    return op


@pytest.mark.parametrize(("last", "lags"), [(1390, 11), (1385, 6)])
def test_op_that_stood_from_shortly_before_on_is_asked_where_it_still_shows(last: int, lags: int) -> None:
    drawn = (np.random.default_rng(seed) for seed in range(60))
    found = [residual_tests(loads(rng), bumped(last), EVERYWHERE, held()).independence for rng in drawn]
    assert {test.lags for test in found} == {lags}
    assert found[0].limit == pytest.approx(chdtri(lags, 0.05))
    assert sum(not test.passed for test in found) <= 7


def test_op_that_stood_for_longer_is_not_asked() -> None:
    assert residual_tests(loads(np.random.default_rng(1)), bumped(1350), EVERYWHERE, held()).independence is None


def test_op_livelier_before_the_stretch_than_in_it_is_not_accused() -> None:
    found = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        steps = rng.normal(size=N) * np.where(np.arange(N) < 1395, 50.0, 1.0)
        late = np.arange(N) >= 1400
        tests = residual_tests(rng.normal(size=N), np.cumsum(steps), EVERYWHERE, late & (np.arange(N) < 1520))
        found.append(tests.independence.p_value)
    assert np.mean(np.array(found) < 0.05) == pytest.approx(0.05, abs=0.05)


def test_an_explanation_shows_that_the_missing_physics_took_what_was_not_white() -> None:
    rng = np.random.default_rng(3)
    op, ts = moves(rng), 2.0
    op = 40.0 + 8.0 * (op - op.mean()) / np.ptp(op) + np.repeat(rng.uniform(-4.0, 4.0, N // 50), 50)
    true = Plant(K=1.4, tau=30.0, theta=14.0)
    pv = 50.0 + run_process(op - 40.0, true, ts) + 0.05 * loads(rng)
    given = LinearSimulation(gain=1.4, time_constants_s=(30.0,), dead_time_s=2.0)
    explanation = explain(Comparison("loop", ts, op, pv, simulation=given))
    assert explanation.effects[0].code == "process.dead_time"
    refitted, explained = line_of(explanation.fit.refitted), line_of(explanation.fit.explained)
    assert refitted["independence"]["statistic"] > refitted["independence"]["limit"]
    assert explained["independence"]["statistic"] < explained["independence"]["limit"]
    assert explained["whiteness"]["statistic"] < explained["whiteness"]["limit"]
