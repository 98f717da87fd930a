"""The order search beside a state-space library fitting the same orders, and beside this machine's arithmetic.

Times are printed and belong to the machine; what is asserted are ratios, loosely enough for any machine. They are
seconds of one thread's processor time, so that other work on the machine disturbs them less.
"""

import time
import warnings

import numpy as np
import pytest

from app.engine.armax import Order, SearchSpace, refine, search_orders
from app.engine.recording import UniformRecord
from app.engine.reference.hammerstein import Identification
from app.engine.valve import one_parameter, two_parameter_he
from app.lab.bench.measure import median_s

pytestmark = [pytest.mark.benchmark, pytest.mark.shared]

SPACE = SearchSpace(5, 5, 10, nc_min=0)
"""275 orders; with 30 values of d, 8,250 fits."""

LEAST_RATIO, LEAST_RATIO_OF_A_FIT = 50.0, 3e5
"""How many times as fast as the peer a refined fit is at least, and a fit of the search, as docs/PERFORMANCE.md
promises."""

SAMPLED_ORDERS = [Order(1, 1, 1), Order(2, 1, 2), Order(3, 2, 3), Order(4, 1, 4)]
"""Small ones of the 275, to be done within the minute: the ratio of the average order is larger."""


@pytest.fixture(scope="module")
def fc145(shared_dir):
    data = np.genfromtxt(shared_dir / "recordings" / "CHEM1.csv", delimiter=",", names=True)
    return UniformRecord(1.0, data["PV"], data["OP"], None, np.zeros(len(data), dtype=bool))


@pytest.fixture(scope="module")
def signals(fc145):
    """PV and OP at unit standard deviation, and the valve positions of the one- and two-parameter grids."""
    pv, op = ((x - x.mean()) / x.std() for x in (fc145.pv, fc145.op))
    one = one_parameter(op, np.linspace(0.0, 0.58, 30) * np.ptp(op))
    S, share = (x.ravel() for x in np.meshgrid(np.linspace(0.04, 0.8, 20), np.linspace(0.0, 1.0, 5), indexing="ij"))
    return pv, one, two_parameter_he(op, S * np.ptp(op), share * S * np.ptp(op))


def statsmodels_fit_s(pv, v, order, first):
    """Seconds for one exact maximum-likelihood fit of the order: a regression on the lags with MA(nc) errors."""
    lags = [pv[first - i : len(pv) - i] for i in range(1, order.na + 1)]
    lags += [v[first - j : len(v) - j] for j in range(1, order.nb + 1)]
    from statsmodels.tsa.statespace.sarimax import SARIMAX  # half a second, which each test process would take

    model = SARIMAX(pv[first:], exog=np.column_stack(lags), order=(0, 0, order.nc), concentrate_scale=True)
    start = time.thread_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.fit(disp=0)
    return time.thread_time() - start


def gram_products(search, points):
    """Products that the Gram matrices need at least: each distinct pair of lags once, over all samples."""
    p, space = search.long_order, search.space
    long_lags = 3 * p + 1
    innovation_lags = 3 * space.nc_max + space.na_max + space.nb_max
    return points * (long_lags + innovation_lags)


def products_a_second():
    """What one core reaches in a matrix product, from matrices too small for BLAS to share among threads."""
    a, b = np.random.default_rng(0).normal(size=(2, 64, 64))
    return 100 * 64**3 / median_s(lambda: [a @ b for _ in range(100)], 25)


def test_one_and_two_parameter_search(signals):
    pv, one, two = signals
    a_fit = {}
    for name, v in (("one-parameter, 30 values of d", one), ("two-parameter, 100 points (S, J)", two)):
        fits = len(v) * SPACE.orders
        seconds = median_s(lambda v=v: search_orders(pv, v, SPACE), 25)
        a_fit[name] = seconds / fits
        search = search_orders(pv, v, SPACE)
        products = gram_products(search, len(v)) * len(pv)
        peak = products_a_second()
        print(
            f"\n{name} x {SPACE.orders} orders, N = {len(pv)}: {1e3 * seconds:.2f} ms, {fits} fits, "
            f"{1e9 * seconds / fits:.0f} ns a fit; with a third regression "
            f"{1e3 * median_s(lambda v=v: search_orders(pv, v, SPACE, stages=3), 25):.2f} ms, with three steps more "
            f"{1e3 * median_s(lambda v=v: search_orders(pv, v, SPACE, steps=3), 25):.2f} ms"
        )
        print(
            f"  the Gram matrices need {products / 1e6:.1f} M products: {1e3 * products / peak:.3f} ms at the "
            f"{peak / 1e9:.0f} G products a second of this machine's matrix product"
        )
    # What does not depend on the valve is done once: more points make none dearer.
    assert max(a_fit.values()) < 2.0 * min(a_fit.values())


def test_ratio_to_statsmodels(signals):
    pv, one, _ = signals
    search = search_orders(pv, one, SPACE)
    a_fit = median_s(lambda: search_orders(pv, one, SPACE), 25) / (len(one) * SPACE.orders)
    peers = []
    for order in SAMPLED_ORDERS:
        peer = statsmodels_fit_s(pv, one[0] - one[0].mean(), order, search.first_sample)
        ours = median_s(lambda order=order: refine(pv, one[0], order), 5)
        peers.append(peer)
        ratio = peer / ours
        print(f"\n{order}: statsmodels {peer:.2f} s, one refined fit {1e3 * ours:.2f} ms, ratio {ratio:.0f}", end="")
        assert ratio > LEAST_RATIO
    mean = float(np.mean(peers))
    print(f"\na fit: statsmodels {mean:.2f} s on average, the search {1e9 * a_fit:.0f} ns: ratio {mean / a_fit:,.0f}")
    print(f"the whole search would take statsmodels about {mean * len(one) * SPACE.orders / 3600:.1f} h")
    assert mean / a_fit > LEAST_RATIO_OF_A_FIT


def test_identification(fc145):
    for bounds in ((2, 2, 2), (5, 5, 5), (5, 5, 10), (5, 5, 25), (10, 10, 25), (25, 25, 25)):
        space = SearchSpace(*bounds)
        one, two = (
            1e3 * median_s(lambda f=identify, s=space: f(Identification(fc145), s), 5)
            for identify in (Identification.one_parameter, Identification.two_parameter)
        )
        print(f"\nidentification in {bounds}: one-parameter {one:.1f} ms, two-parameter {two:.1f} ms", end="")
        assert two < 10.0 * one
    print()


def test_growth_with_samples():
    rng = np.random.default_rng(0)
    previous = None
    for samples in (500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000):
        op = np.sin(np.arange(samples) / 15.0) + 0.1 * rng.normal(size=samples)
        pv = np.convolve(op, 0.2 * 0.8 ** np.arange(40))[:samples] + 0.05 * rng.normal(size=samples)
        v = one_parameter(op, np.linspace(0.0, 1.0, 30))
        seconds = median_s(lambda pv=pv, v=v: search_orders(pv, v, SPACE), 5)
        growth = 1.0 if previous is None else seconds / previous[1] / (samples / previous[0])
        print(
            f"\nN = {samples}: {1e3 * seconds:.2f} ms, {1e9 * seconds / samples:.0f} ns a sample, "
            f"{growth:.2f} of linear"
        )
        assert growth < 2.0
        previous = samples, seconds
    print()
