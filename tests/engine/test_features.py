"""Shapes in numbers: what they are on signals drawn by hand, and that no unit changes them."""

from itertools import pairwise

import numpy as np
import pytest

from app.engine.features import NAMES, extract, shape_windows, standing
from app.engine.features.shape import bicoherence, harmonic_shares, triangle_index
from app.engine.oscillation import detect
from app.engine.recording import UniformRecord
from app.engine.signals.sampled import log_kurtosis, moving_average, quantiles, resample, without_drift

PERIOD = 50
N = 1000
T = np.arange(N)


def record(pv, op) -> UniformRecord:
    return UniformRecord(1.0, np.asarray(pv, float), np.asarray(op, float), None, np.zeros(N, bool))


def triangle(shift: float = 0.0) -> np.ndarray:
    return 2 / np.pi * np.arcsin(np.sin(2 * np.pi * (T - shift) / PERIOD))


def sticky() -> UniformRecord:
    """OP ramps, PV stands on one of two levels and jumps when OP has travelled far enough: the textbook."""
    noise = 0.02 * np.random.default_rng(0).normal(size=(2, N))
    return record(np.sign(np.cos(2 * np.pi * (T + 3) / PERIOD)) + noise[0], triangle() + 0.1 * noise[1])


def in_line() -> UniformRecord:
    """A P controller under an irregular disturbance: OP is PV turned around."""
    rng = np.random.default_rng(1)
    pv = np.convolve(rng.normal(size=N + 20), np.ones(21) / 21, "valid")
    return record(pv, -2 * pv + 0.02 * rng.normal(size=N))


def named(loop: UniformRecord) -> dict[str, float]:
    features = extract(loop, detect(loop))
    assert features is not None
    return dict(zip(NAMES, features.values, strict=True))


def test_a_sticky_valve_shows_quadrature_stillness_and_a_better_free_run():
    stuck, linear = named(sticky()), named(in_line())
    for name in ("ccf_odd", "op_dpv", "loop_area", "leg_still", "flat_eighth", "pv_direction", "gain"):
        assert stuck[name] > linear[name] + 0.05, name
    for name in ("ccf_zero", "coherence_even", "together_quarter", "op_kurtosis"):
        assert stuck[name] < linear[name], name


def test_every_feature_is_a_finite_number_with_a_name_of_its_own():
    assert len(set(NAMES)) == len(NAMES)
    for loop in (sticky(), in_line()):
        features = extract(loop, detect(loop))
        assert features.table.shape[1] == len(NAMES)
        assert np.all(np.isfinite(features.table))


@pytest.mark.parametrize("unit", [(-1.0, 0.0, 1.0, 0.0), (1.0, 0.0, -1.0, 100.0), (1e-4, 273.15, 3.7, -40.0)])
def test_no_feature_changes_with_the_unit(unit):
    pv_scale, pv_offset, op_scale, op_offset = unit
    for loop in (sticky(), in_line()):
        other = record(loop.pv * pv_scale + pv_offset, loop.op * op_scale + op_offset)
        one, two = extract(loop, detect(loop)), extract(other, detect(other))
        np.testing.assert_allclose(two.values, one.values, rtol=1e-5, atol=1e-6)


def test_no_feature_changes_with_the_time_unit():
    loop = sticky()
    slow = UniformRecord(3600.0, loop.pv, loop.op, None, loop.filled)
    np.testing.assert_array_equal(extract(slow, detect(slow)).values, extract(loop, detect(loop)).values)


def test_what_does_not_vary_has_no_features():
    loop = record(np.full(N, 4.0), triangle())
    assert extract(loop, detect(loop)) is None


def test_windows_have_forty_samples_a_cycle_and_unit_deviation():
    windows = shape_windows(sticky(), detect(sticky()), most=3)
    assert len(windows) == 2
    for window in windows:
        assert len(window.pv) == pytest.approx(15 * 40, abs=25)
        assert window.pv.std() == pytest.approx(1.0)
        assert window.op.std() == pytest.approx(1.0)


def test_triangle_index_tells_a_triangle_from_a_sine():
    assert triangle_index(triangle()) > 0.75
    assert triangle_index(np.sin(2 * np.pi * T / PERIOD)) < 0.2


@pytest.mark.parametrize(
    ("x", "expected"),
    [
        (np.sign(np.sin(2 * np.pi * (T + 0.5) / PERIOD)), 0.0),
        (np.sin(2 * np.pi * T / PERIOD), np.log(1.5)),
        (triangle(), np.log(1.8)),
        (np.random.default_rng(0).normal(size=100_000), np.log(3.0)),
    ],
)
def test_kurtosis_knows_square_sine_triangle_and_noise(x, expected):
    assert log_kurtosis(x) == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize("n", [1, 2, 3, 21, 1000])
def test_quantiles_lie_on_straight_lines_between_sorted_values(n):
    x, shares = np.random.default_rng(n).normal(size=n), (0.0, 0.01, 0.05, 0.5, 0.99, 1.0)
    assert quantiles(x, shares) == pytest.approx(np.quantile(x, shares), abs=1e-12)


def test_harmonic_shares_add_up_and_find_the_third_of_the_one_and_the_second_of_the_other():
    t = np.arange(599)
    one = np.sin(2 * np.pi * t / 40) + np.sin(6 * np.pi * t / 40)
    other = 100.0 * np.cos(4 * np.pi * t / 40)
    shares, of_other = harmonic_shares(one, other)
    assert shares.sum() == pytest.approx(1.0, abs=1e-6)
    assert of_other.sum() == pytest.approx(1.0, abs=1e-6)
    assert shares[1] == pytest.approx(0.5, abs=0.02)
    assert shares[3] == pytest.approx(0.5, abs=0.02)
    assert of_other[2] == pytest.approx(1.0, abs=0.02)
    power, cycles = np.abs(np.fft.rfft(one * np.hanning(599))) ** 2, np.arange(300) * 40 / 599
    bands = [power[(low <= cycles) & (cycles < high)].sum() for low, high in pairwise((0, 0.5, 1.5, 2.5, 3.5, np.inf))]
    assert shares == pytest.approx(np.array(bands) / power.sum(), abs=1e-9)


def test_bicoherence_sees_phase_coupling_and_not_noise():
    t = np.arange(1200)
    noise = np.random.default_rng(2).normal(size=1200)
    coupled = np.sin(2 * np.pi * t / 40) + 0.5 * np.sin(4 * np.pi * t / 40) + 0.1 * noise
    assert bicoherence(coupled) > 0.3
    assert abs(bicoherence(noise)) < 0.15


def test_resampling_averages_downwards_and_interpolates_upwards():
    np.testing.assert_allclose(resample(np.arange(80.0), 80.0, 40), np.arange(80.0).reshape(-1, 2).mean(axis=1))
    np.testing.assert_allclose(resample(np.arange(20.0), 10.0, 20), np.linspace(0, 19, 40))


def test_moving_average_is_shorter_at_the_ends():
    np.testing.assert_allclose(moving_average(np.array([1.0, 2.0, 3.0, 10.0]), 1), [1.5, 2.0, 5.0, 6.5])


def test_a_straight_line_has_no_deviation_left():
    np.testing.assert_allclose(without_drift(3.0 + 2.0 * np.arange(50.0), 100), 0.0, atol=1e-9)


def test_a_straight_line_does_not_step_by_a_resolution():
    line = np.linspace(0.0, 1.0, 2000)
    assert named(record(line, line**2))["pv_quantum"] == 0.0
    assert named(record(np.floor(40.0 * line), line**2))["pv_quantum"] > 0.0


def test_where_op_travels_and_pv_stands_is_what_the_share_counts():
    loop = sticky()
    marked = standing(loop.pv, loop.op, PERIOD)
    travel = np.abs(np.diff(loop.op))
    assert travel[marked[1:]].sum() / travel.sum() == pytest.approx(named(loop)["flat_eighth"], abs=0.1)
    assert not marked[np.flatnonzero(np.abs(np.diff(loop.pv)) > 1.0)].any()


@pytest.mark.parametrize(("pv", "op"), [(np.zeros(N), triangle()), (triangle(), np.zeros(N)), (triangle(), triangle())])
def test_nothing_stands_where_pv_or_op_never_varies_or_pv_follows(pv, op):
    assert np.mean(standing(pv, op, PERIOD)) < 0.01
