"""Prediction-error minimisation: against a general least-squares solver, and against exact maximum likelihood."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter

from app.engine.armax import Order, SearchSpace, estimate_order, refine, search_orders
from app.engine.armax.predict import SLOWEST_ROOT, is_stable, prediction_errors
from app.engine.valve import one_parameter


def record(samples=800, seed=0):
    rng = np.random.default_rng(seed)
    v = np.sign(rng.normal(size=samples // 8 + 1)).repeat(8)[:samples]
    e = 0.2 * rng.normal(size=samples)
    y = lfilter([0.0, 0.4, 0.2], [1.0, -0.9, 0.2], v) + lfilter([1.0, -0.7, 0.3], [1.0, -0.9, 0.2], e)
    return y - y.mean(), v - v.mean()


def errors_of(y, v, theta, order):
    """One-step errors from the definition, by a general filter: C eps = A y - B v from sample max(na, nb) on."""
    a, b, c = np.split(theta, [order.na, order.na + order.nb])
    start = max(order.na, order.nb)
    w = lfilter([1.0, *a], [1.0], y) - lfilter([0.0, *b], [1.0], v)
    return np.concatenate((np.zeros(start), lfilter([1.0], [1.0, *c], w[start:])))


def test_prediction_errors_follow_their_definition():
    y, v = record()
    theta, order = np.array([-0.8, 0.1, 0.3, 0.1, -0.2, 0.4]), Order(2, 2, 2)
    errors = np.empty(len(y))
    prediction_errors(y, v, theta[:2], theta[2:4], theta[4:], errors)
    assert np.allclose(errors, errors_of(y, v, theta, order), atol=1e-12)


@pytest.mark.parametrize("order", [Order(2, 2, 2), Order(1, 1, 1), Order(3, 1, 0), Order(2, 3, 4)])
def test_the_minimum_is_that_of_a_general_solver(order):
    y, v = record()
    model = refine(y, v, order, tolerance=1e-14)
    theta = np.concatenate((model.a, model.b, model.c))
    solved = least_squares(lambda p: errors_of(y, v, p, order)[model.first_sample :], theta, method="lm", xtol=1e-12)
    assert np.sqrt(np.mean(solved.fun**2)) == pytest.approx(model.rmse, rel=1e-6)
    assert model.converged


def test_the_parameters_of_a_simulation_are_recovered():
    y, v = record(samples=6000)
    model = refine(y, v, Order(2, 2, 2))
    assert model.a == pytest.approx([-0.9, 0.2], abs=0.05)
    assert model.b == pytest.approx([0.4, 0.2], abs=0.03)
    assert model.c == pytest.approx([-0.7, 0.3], abs=0.07)
    assert model.rmse == pytest.approx(0.2, rel=0.03)
    assert model.order == Order(2, 2, 2)


def test_criteria_are_those_of_the_residuals():
    y, v = record()
    model = refine(y, v, Order(2, 1, 1))
    samples = len(y) - model.first_sample
    assert model.aic_paper == pytest.approx(model.rmse**2 + 8 / samples)
    assert model.aic_log == pytest.approx(np.log(model.rmse**2) + 8 / samples)


@pytest.mark.parametrize(("y_scale", "v_scale"), [(1.0, 1.0), (25.0, 0.1), (0.02, 300.0)])
def test_a_rescaled_model_is_the_one_of_the_rescaled_signals(y_scale, v_scale):
    y, v = record()
    model, other = (
        refine(y, v, Order(2, 1, 1)).rescaled(y_scale, v_scale),
        refine(y_scale * y, v_scale * v, Order(2, 1, 1)),
    )
    for name in ("a", "b", "c", "rmse", "aic_paper", "aic_log"):
        assert getattr(model, name) == pytest.approx(getattr(other, name), rel=1e-5), name


def test_polishing_lowers_every_point_and_refining_lowers_it_further():
    y, v = record()
    grid = np.stack([v, np.roll(v, 2), v**3 + np.arange(len(v)) / 500.0])
    search = search_orders(y, grid, SearchSpace(4, 4, 6))
    polished = search_orders(y, grid, SearchSpace(4, 4, 6), steps=3)
    assert np.all(polished.rmse <= search.rmse)
    assert np.array_equal(polished.aic, search.aic)
    for m in range(3):
        model = refine(y, grid[m], search.order(m), polished, m)
        assert model.rmse <= polished.rmse[m] * (1.0 + 1e-12)
        assert is_stable(model.c, SLOWEST_ROOT)


def test_a_scale_changes_only_the_unit():
    y, v = record()
    plain, scaled = refine(y, v, Order(2, 2, 2)), refine(-1000.0 * y, 0.01 * v, Order(2, 2, 2))
    assert scaled.a == pytest.approx(plain.a, rel=1e-4)
    assert scaled.c == pytest.approx(plain.c, rel=1e-3)
    assert scaled.b == pytest.approx(-1e5 * plain.b, rel=1e-3)
    assert scaled.rmse == pytest.approx(1000.0 * plain.rmse, rel=1e-7)


def exact_aic(y, v, order, first):
    """Ljung's AIC of an ARMAX order by exact maximum likelihood of its moving average, in a state-space library.

    A y = B v + C e is a regression of y(t) on its own and v's lags with errors C e, an MA(nc): that is the same model.
    SARIMAX(na, 0, nc) with v as regressor is not, there v passes through B alone and only the noise through 1/A.
    """
    lags = [y[first - i : len(y) - i] for i in range(1, order.na + 1)]
    lags += [v[first - j : len(v) - j] for j in range(1, order.nb + 1)]
    from statsmodels.tsa.statespace.sarimax import SARIMAX  # half a second, which each test process would take

    fit = SARIMAX(y[first:], exog=np.column_stack(lags), order=(0, 0, order.nc), concentrate_scale=True).fit(
        disp=0, maxiter=200, warn_convergence=False
    )
    samples = len(y) - first
    return -2.0 * fit.llf / samples - np.log(2.0 * np.pi) - 1.0 + 2.0 * order.parameters / samples


@pytest.fixture
def stretch(shared_dir):
    """PV and a valve position of a recording, as the identification sees them."""

    def load(name, samples, share):
        data = np.genfromtxt(shared_dir / "recordings" / f"{name}.csv", delimiter=",", names=True)[:samples]
        pv, op = data["PV"] - data["PV"].mean(), data["OP"]
        valve = one_parameter(op, np.array([share * np.ptp(op)]))[0]
        return pv / pv.std(), (valve - valve.mean()) / op.std()

    return load


# Recording, samples, d as a share of OP's range, and how far the fast winner may be behind, in units of N times AIC
# (a unit of 2 is one coefficient).
RANKED = [("PAP2", 600, 0.1, 0.5), ("CHEM1", 600, 0.1, 10.0), ("CHEM2", 600, 0.1, 25.0)]


@pytest.mark.shared
@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::statsmodels.tools.sm_exceptions.ConvergenceWarning")
@pytest.mark.parametrize(("name", "samples", "share", "allowance"), RANKED)
def test_the_fast_search_and_exact_fits_rank_alike(stretch, name, samples, share, allowance):
    """The winner is the exact one on FC525, and on the others behind it by less than the stated allowance."""
    y, v = stretch(name, samples, share)
    space = SearchSpace(3, 2, 2)
    fast = search_orders(y, v[None, :], space)
    orders = [Order(*o) for o in product(range(1, 4), range(1, 3), range(1, 3))]
    exact = {order: exact_aic(y, v, order, fast.first_sample) for order in orders}
    judged = samples - fast.first_sample
    behind = judged * (exact[fast.order(0)] - min(exact.values()))
    fast_rank = {o: estimate_order(y, v[None, :], o, space).aic[0] for o in orders}
    print(f"{name}: fast {fast.order(0)}, exact {min(exact, key=exact.get)}, {behind:.2f} units of N AIC behind")
    assert fast.order(0) == min(fast_rank, key=fast_rank.get)
    assert behind <= allowance
