"""Period, regularity and strength of an oscillation, whatever the unit, the offset and the trend."""

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.oscillation import FEW_INTERVALS, autocorrelation, detect
from app.engine.recording import UniformRecord

N = 1200


def record(pv, op, sp=None, interval_s=1.0) -> UniformRecord:
    return UniformRecord(interval_s, np.asarray(pv, float), np.asarray(op, float), sp, np.zeros(len(pv), bool))


def cycle(period: float, n: int = N) -> np.ndarray:
    return np.sin(2 * np.pi * np.arange(n) / period)


@pytest.mark.parametrize("period", [8.0, 25.0, 60.0, 200.0])
def test_the_period_of_a_noisy_cycle_is_found(period):
    noise = 0.3 * np.random.default_rng(1).normal(size=(2, N))
    found = detect(record(cycle(period) + noise[0], np.roll(cycle(period), 5) + noise[1]))
    assert found.period_s == pytest.approx(period, rel=0.03)
    assert found.regular
    assert found.cycles == pytest.approx(N / period, rel=0.03)


def test_the_period_is_in_seconds():
    found = detect(record(cycle(40), cycle(40), interval_s=30.0))
    assert found.period_s == pytest.approx(1200.0, rel=0.02)
    assert found.samples_per_cycle == pytest.approx(40.0, rel=0.02)


def test_a_slow_trend_does_not_hide_the_cycle():
    drift = 20 * cycle(1500) + 0.01 * np.arange(N)
    found = detect(record(cycle(30) + drift, cycle(30) + 2 * drift))
    assert found.period_s == pytest.approx(30.0, rel=0.05)
    assert found.trend_share > 0.0


def test_a_cycle_that_only_the_control_error_shows_is_found():
    sp = np.cumsum(np.random.default_rng(3).normal(size=N))
    found = detect(record(sp + 0.5 * cycle(24), np.random.default_rng(4).normal(size=N), sp=sp))
    assert (found.signal, found.period_s) == ("error", pytest.approx(24.0, rel=0.05))


def test_noise_is_no_strong_oscillation():
    noise = np.random.default_rng(2).normal(size=(2, N))
    assert detect(record(noise[0], noise[1])).strength < 0.3


@pytest.mark.parametrize("period", [3.4, 4.0, 4.6])
def test_a_regular_turn_of_a_few_samples_is_found(period):
    even = cycle(period) + 0.1 * np.random.default_rng(5).normal(size=N)
    assert detect(record(even, even)).samples_per_cycle == pytest.approx(period, rel=0.03)


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_noise_that_turns_each_four_samples_hides_no_slower_cycle(seed):
    rng = np.random.default_rng(seed)
    noise = lfilter([1.0], [1.0, 0.0, 0.81], rng.normal(size=N))
    slow = 0.6 * np.std(noise) * np.sin(2 * np.pi * np.arange(N) / 30 + np.cumsum(0.12 * rng.normal(size=N)))
    found = detect(record(noise + slow, noise + slow))
    assert found.samples_per_cycle is None or found.samples_per_cycle >= 5.0


def test_nothing_moving_is_no_oscillation():
    found = detect(record(np.full(N, 3.0), np.full(N, 7.0)))
    assert (found.period_s, found.regularity, found.strength, found.regular) == (None, 0.0, 0.0, False)


@pytest.mark.parametrize(("cycles", "regularity"), [(2.2, 0.0), (2.7, FEW_INTERVALS)])
def test_of_few_cycles_nothing_is_seen_and_of_a_little_more_nothing_regular(cycles, regularity):
    found = detect(record(cycle(N / cycles), cycle(N / cycles)))
    assert (found.regularity, found.regular) == (regularity, False)
    assert (found.period_s is None) == (regularity == 0.0)


def test_scale_offset_and_sign_change_nothing():
    noise = 0.2 * np.random.default_rng(5).normal(size=(2, N))
    pv, op = cycle(37) + noise[0], np.roll(cycle(37), 9) + noise[1]
    one, other = detect(record(pv, op)), detect(record(-1e-3 * pv + 300.0, 16 * op - 4))
    assert other.period_s == pytest.approx(one.period_s, rel=1e-6)
    assert other.regularity == pytest.approx(one.regularity, rel=1e-4)


def test_long_records_are_thinned_and_keep_their_period():
    found = detect(record(cycle(500, 40000), cycle(500, 40000)))
    assert found.period_s == pytest.approx(500.0, rel=0.03)


@pytest.mark.parametrize("n", [2, 7, 500, 550, 560, 933, 1000, 1625])
def test_autocorrelation_is_the_sum_of_products_whatever_the_length(n):
    x = np.cumsum(np.random.default_rng(n).normal(size=n))
    moves = x - x.mean()
    lags = np.arange(n // 2)
    direct = np.correlate(moves, moves, "full")[n - 1 :][: n // 2] / (moves @ moves) * n / (n - lags)
    assert autocorrelation(x) == pytest.approx(direct, abs=1e-9)


def test_autocorrelation_of_a_sine_is_a_cosine_and_of_a_constant_zero():
    acf = autocorrelation(cycle(20))
    np.testing.assert_allclose(acf[:41:20], 1.0, atol=0.02)
    assert not autocorrelation(np.full(64, 5.0)).any()


def test_the_strength_of_a_pure_cycle_is_one_and_not_more():
    found = detect(record(cycle(20, 120), cycle(20, 120)))
    assert found.strength == 1.0


@pytest.mark.parametrize("ramp", [0.0013, 0.003])
def test_a_rounded_ramp_does_not_swing_by_its_rounding(ramp):
    noise = np.random.default_rng(3).normal(size=N)
    found = detect(record(cycle(60.0) + 0.8 * noise, np.round(50.0 + ramp * np.arange(N), 2)))
    assert found.signal == "pv"
    assert found.period_s == pytest.approx(60.0, rel=0.05)


def test_a_rounded_ramp_that_was_filled_in_here_and_there_does_not_swing_either():
    n = 8000
    noise, op = np.random.default_rng(3).normal(size=n), np.round(50.0 + 0.0013 * np.arange(n), 2)
    op[4000:4006] = np.linspace(op[4000], op[4006], 6)
    found = detect(record(cycle(60.0, n) + 0.8 * noise, op))
    assert found.signal == "pv"
    found = detect(
        record(cycle(60.0, 20_000) + 0.8 * np.resize(noise, 20_000), np.round(0.0013 * np.arange(20_000), 2))
    )
    assert found.signal == "pv"


def test_a_cycle_between_two_steps_of_a_coarse_sensor_swings():
    found = detect(record(np.round(0.5 + 0.4 * cycle(60.0)), np.round(50.0 + 0.003 * np.arange(N), 2)))
    assert (found.signal, found.regular) == ("pv", True)


@pytest.mark.parametrize("up", [5, 12, 50])
def test_a_cycle_of_two_values_swings_however_short_the_one_is(up):
    found = detect(record(np.where(np.arange(N) % 100 < up, 1.0, 0.0), np.full(N, 50.0)))
    assert found.period_s == pytest.approx(100.0, rel=0.05)
