"""The order search: its parts against plain linear algebra, what no unit changes, and records that tell nothing."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.signal import lfilter

from app.engine.armax import Order, SearchSpace, estimate_order, refine, search_orders
from app.engine.armax.gram import add_lagged, fill_lagged_gram, fill_own_gram
from app.engine.armax.kernel import criterion_value, least, sweep_orders, sweep_rooms
from app.engine.armax.predict import SLOWEST_ROOT, filter_by_c, is_stable, reflect_to_stable
from app.engine.armax.roots import roots_of
from app.errors import DataError, RequestError


def armax_record(samples=3000, seed=0, noise=0.1):
    """y of (1 - 1.5 q^-1 + 0.7 q^-2) y = 0.5 q^-1 v + (1 + 0.6 q^-1) e, and v, coloured noise."""
    rng = np.random.default_rng(seed)
    v = lfilter([1.0], [1.0, -0.8], rng.normal(size=samples))
    e = noise * rng.normal(size=samples)
    y = lfilter([0.0, 0.5], [1.0, -1.5, 0.7], v) + lfilter([1.0, 0.6], [1.0, -1.5, 0.7], e)
    return y, v


def lagged(x, lags, first):
    return np.column_stack([x[first - lag : len(x) - lag] for lag in lags])


def test_lagged_gram_is_the_product_of_lag_matrices():
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=80), rng.normal(size=80)
    gram = np.zeros((8, 9))
    fill_lagged_gram(gram, 2, 1, x, y, (1, 5, 0, 7), 12)
    assert np.allclose(gram[2:7, 1:8], lagged(x, range(1, 6), 12).T @ lagged(y, range(7), 12), atol=1e-12)


def test_the_gram_matrix_of_one_signal_has_its_upper_triangle():
    x, gram = np.random.default_rng(1).normal(size=200), np.zeros((9, 9))
    fill_own_gram(gram, 2, x, (1, 7), 12)
    whole = lagged(x, range(1, 8), 12).T @ lagged(x, range(1, 8), 12)
    assert np.allclose(gram[2:, 2:], np.triu(whole), atol=1e-12)


@pytest.mark.parametrize("lags", [0, 1, 2, 4, 6, 7])
def test_lags_are_weighted_from_the_last_sample_on(lags):
    rng = np.random.default_rng(2)
    x, out, weights = rng.normal(size=50), rng.normal(size=50), rng.normal(size=lags)
    expected = np.concatenate((out[:8], out[8:] + lagged(x, range(1, lags + 1), 8) @ weights)) if lags else out.copy()
    add_lagged(out, weights, x, 8)
    assert np.allclose(out, expected, atol=1e-12)


@pytest.mark.parametrize(
    "c",
    [
        np.random.default_rng(4).normal(size=25),
        np.random.default_rng(5).normal(size=10) * 3.0,
        [0.5],
        [-2.0, 1.0],  # one root twice
        [0.0, 0.0, -8.0, 0.0, 0.0],  # roots at 0
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, -1.0],
    ],
)
def test_roots_are_the_eigenvalues_of_the_companion_matrix(c):
    c = np.asarray(c)
    found, expected = roots_of(c), np.roots(np.concatenate(([1.0], c)))
    expected = np.concatenate((expected, np.zeros(len(c) - len(expected))))
    assert len(found) == len(c)
    assert np.allclose(np.abs(found[:, None] - expected).min(axis=0), 0.0, atol=1e-7)
    assert np.allclose(np.abs(found[:, None] - expected).min(axis=1), 0.0, atol=1e-7)


def test_every_order_of_the_sweep_is_its_own_regression():
    rng = np.random.default_rng(3)
    na, nb, nc, samples = 3, 2, 4, 60
    columns = rng.normal(size=(samples, na + nb + nc + 1)).cumsum(axis=0)
    residuals = np.empty((na, nb, nc + 1))
    sweep_orders(columns.T @ columns, (na, nb, nc), sweep_rooms((na, nb, nc)), residuals)
    for i, j, k in np.ndindex(na, nb, nc + 1):
        chosen = [*range(i + 1), *range(na, na + j + 1), *range(na + nb, na + nb + k)]
        expected = np.linalg.lstsq(columns[:, chosen], columns[:, -1], rcond=None)[1][0]
        assert residuals[i, j, k] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("logarithmic", [False, True])
@pytest.mark.parametrize("nc_min", [0, 1])
def test_the_chosen_order_has_the_least_criterion(logarithmic, nc_min):
    samples, residuals = 60, np.random.default_rng(4).uniform(50.0, 70.0, (4, 3, 6))
    parameters = 2 + sum(np.meshgrid(*map(np.arange, residuals.shape), indexing="ij"))
    values = criterion_value.py_func(residuals, samples, parameters, logarithmic)[:, :, nc_min:]
    i, j, k = np.unravel_index(np.argmin(values), values.shape)
    assert least(residuals, samples, logarithmic, nc_min) == (i + 1, j + 1, k + nc_min)
    assert least(np.ones((4, 3, 6)), samples, logarithmic, nc_min) == (1, 1, nc_min)


def test_the_order_and_coefficients_of_a_simulation_are_found():
    y, v = armax_record(seed=1)
    search = search_orders(y, v[None, :], SearchSpace(4, 3, 4), stages=3)
    assert search.order(0) == Order(2, 1, 1)
    assert search.a[0] == pytest.approx([-1.5, 0.7, 0.0, 0.0], abs=0.01)
    assert search.b[0] == pytest.approx([0.5, 0.0, 0.0], abs=0.01)
    assert search.c[0] == pytest.approx([0.6, 0.0, 0.0, 0.0], abs=0.04)
    assert search.rmse[0] == pytest.approx(0.1, rel=0.03)


def test_the_third_regression_is_a_step_towards_the_least_error():
    """At one and the same order it brings the one-step error of the second nearer to its minimum."""
    y, v = armax_record(samples=600, seed=4)
    space = SearchSpace(2, 1, 1)
    second, third = (search_orders(y, v[None, :], space, stages=stages) for stages in (2, 3))
    least = refine(y, v, second.order(0), second).rmse
    assert third.order(0) == second.order(0) == Order(2, 1, 1)
    assert least <= third.rmse[0] < second.rmse[0]


def test_a_grid_is_its_points_and_inputs_are_left_alone():
    y, v = armax_record(samples=600)
    grid = np.stack([v, np.roll(v, 1), v**2])
    before = y.copy(), grid.copy()
    search = search_orders(y, grid, SearchSpace(3, 3, 3))
    assert np.array_equal(y, before[0])
    assert np.array_equal(grid, before[1])
    for m in range(3):
        alone = search_orders(y, grid[m : m + 1], SearchSpace(3, 3, 3))
        assert alone.order(0) == search.order(m)
        assert alone.rmse[0] == search.rmse[m]


@given(st.integers(-10, 10), st.integers(-10, 10), st.sampled_from([-1.0, 1.0]), st.integers(-1000, 1000))
def test_units_signs_and_zeros_do_not_change_the_order(y_power, v_power, sign, zero):
    y, v = armax_record(samples=500)
    plain = search_orders(y, v[None, :], SearchSpace(3, 2, 3))
    y, v = sign * 2.0**y_power * (y + zero), 2.0**v_power * (v - zero)
    changed = search_orders(y, v[None, :], SearchSpace(3, 2, 3))
    assert changed.order(0) == plain.order(0)
    assert changed.rmse[0] == pytest.approx(2.0**y_power * plain.rmse[0], rel=1e-6)


def test_the_papers_criterion_depends_on_the_unit_of_pv():
    """Eq 7 adds 2 dM/N to a mean square: in a small unit of PV the penalty decides, in a large one it is nothing."""
    y, v = armax_record(samples=1000)
    small = search_orders(0.001 * y, v[None, :], SearchSpace(5, 5, 5), "paper")
    large = search_orders(1000.0 * y, v[None, :], SearchSpace(5, 5, 5), "paper")
    assert small.order(0) == Order(1, 1, 1)
    assert large.order(0) == Order(5, 5, 5)


def test_arx_is_in_the_space_when_asked_for():
    v, e = np.random.default_rng(5).normal(size=(2, 3000))
    y = lfilter([0.0, 0.5], [1.0, -0.9], v) + lfilter([1.0], [1.0, -0.9], e)
    assert search_orders(y, v[None, :], SearchSpace(3, 3, 3, nc_min=0), stages=3).order(0) == Order(1, 1, 0)
    assert SearchSpace(5, 5, 10, nc_min=0).orders == 275


def test_one_order_within_a_space_is_judged_over_the_spaces_samples():
    y, v = armax_record(samples=600)
    space = SearchSpace(3, 2, 3)
    search = search_orders(y, v[None, :], space)
    alone = estimate_order(y, v[None, :], search.order(0), space)
    assert alone.first_sample == search.first_sample
    assert alone.aic[0] == search.aic[0]
    assert alone.rmse[0] == search.rmse[0]


@pytest.mark.parametrize(
    "valve",
    [np.zeros(400), np.full(400, 1e9), np.repeat([0.0, 1.0], 200), np.arange(400.0)],
    ids=["stuck", "stuck far away", "one step", "ramp"],
)
def test_a_valve_that_tells_little_still_gives_finite_models(valve):
    y = np.random.default_rng(7).normal(size=400).cumsum()
    search = search_orders(y, valve[None, :], SearchSpace(5, 5, 10))
    assert np.all(np.isfinite([search.aic[0], search.rmse[0], *search.a[0], *search.b[0], *search.c[0]]))


@pytest.mark.parametrize("y", [np.sin(np.arange(900) / 7.0), np.repeat(np.arange(9.0), 100), (-1.0) ** np.arange(900)])
def test_noise_free_and_collinear_records_do_not_end_in_nan(y):
    search = search_orders(y, np.stack([y, np.roll(y, 3), 0.0 * y]), SearchSpace(25, 25, 25))
    assert np.all(np.isfinite(search.aic))
    assert np.all(np.isfinite(search.rmse))
    assert np.all(search.rmse < np.ptp(y))


def test_the_largest_space_of_the_ladder_is_searched():
    y, v = armax_record(samples=1200)
    search = search_orders(y, v[None, :], SearchSpace(25, 25, 25))
    assert np.isfinite(search.aic[0])
    assert search.rmse[0] == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize(
    ("y", "v", "code"),
    [
        (np.zeros(300), np.ones((1, 300)), "flat_signal"),
        (np.arange(300.0), np.ones((1, 299)), "signal_length"),
        (np.where(np.arange(300) == 5, np.nan, 1.0), np.ones((1, 300)), "not_finite"),
        (np.arange(20.0), np.ones((1, 20)), "record_too_short"),
    ],
)
def test_what_cannot_be_searched_is_refused(y, v, code):
    with pytest.raises(DataError) as error:
        search_orders(y, v, SearchSpace(5, 5, 5))
    assert error.value.code == code


@pytest.mark.parametrize("bounds", [(0, 1, 1), (1, 51, 1), (1, 1, 1, 2)])
def test_a_space_has_bounds(bounds):
    with pytest.raises(RequestError):
        SearchSpace(*bounds)


coefficients = st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=6).map(np.array)


@given(coefficients)
def test_stability_is_that_of_the_roots(c):
    radius = np.max(np.abs(np.roots(np.concatenate(([1.0], c)))), initial=0.0)
    if abs(radius - 1.0) > 1e-6:
        assert is_stable(c, 1.0) == (radius < 1.0)


@given(coefficients)
@example(np.array([1.0, 2.225073858507e-311]))
def test_reflection_makes_stable(c):
    reflect_to_stable(c)
    assert is_stable(c, SLOWEST_ROOT)


def test_reflection_keeps_the_shape_of_the_spectrum():
    c = np.array([2.5, 1.0])  # roots -2 and -0.5
    reflect_to_stable(c)
    assert c == pytest.approx([1.0, 0.25])


@pytest.mark.parametrize("samples", [0, 2, 6, 46, 47, 48, 49])
@pytest.mark.parametrize("order", [0, 1, 3, 4, 12])
def test_filter_by_c_is_a_recursive_filter(order, samples):
    rng = np.random.default_rng(8)
    x, c, out = rng.normal(size=(3, samples)), rng.normal(size=order) / (order + 1), np.zeros((3, samples))
    filter_by_c(x, c, out)
    expected = lfilter([1.0], [1.0, *c], x) if samples else x
    assert np.allclose(out, expected, atol=1e-12)
    filter_by_c(x, c, x)
    assert np.array_equal(x, out)


@pytest.mark.parametrize("value", [0.0, 1.0, 0.1, -1.7356478123, 1e6 / 3.0])
def test_a_valve_that_never_moves_tells_nothing_wherever_it_stands(value):
    """Rounding of its mean left the same of it at each sample, which was fitted as an intercept: RMSE 2 % less."""
    y, _ = armax_record(samples=1196, seed=3)
    y[200:] += 0.4  # the mean of what is judged is not that of the whole
    space, stands = SearchSpace(5, 5, 10), np.full((1, len(y)), value)
    found, nothing = search_orders(y, stands, space), search_orders(y, 0.0 * stands, space)
    assert (found.rmse[0], found.aic[0]) == (nothing.rmse[0], nothing.aic[0])
    assert not found.b.any()
    exact = refine(y, stands[0], Order(2, 1, 1))
    assert exact.rmse == refine(y, 0.0 * stands[0], Order(2, 1, 1)).rmse
    assert exact.b.tolist() == [0.0]
