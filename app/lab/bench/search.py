"""The order search beside statsmodels and SIPPY on the same record and orders, and beside the machine's arithmetic."""

import math
import os
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import partial
from io import StringIO
from typing import Any

import numpy as np

from app.engine.armax import Order, SearchSpace, refine, search_orders
from app.engine.recording import FloatArray
from app.engine.valve import one_parameter, two_parameter_he
from app.ingest import read_recordings
from app.lab.bench.bench import Bench, Figures, SkippedError
from app.lab.bench.loops import records
from app.lab.bench.measure import median_s

SPACE = SearchSpace(5, 5, 10, nc_min=0)
"""275 orders, as the paper's; with 30 values of d, 8,250 fits."""

PEER_ORDERS = (Order(1, 1, 1), Order(2, 1, 2), Order(2, 2, 1), Order(3, 2, 3), Order(4, 1, 4), Order(5, 5, 10))
"""Compared with the peers, dearer ones last: the ratio over all 275 orders is larger than over the first of these."""

Fit = Callable[[FloatArray, FloatArray, Order, int], float]


@dataclass(frozen=True, eq=False)
class Record:
    """PV and OP at unit standard deviation, with the valve positions of both grids."""

    name: str
    pv: FloatArray
    one: FloatArray
    two: FloatArray


def run(bench: Bench) -> Figures:
    record = _record(bench)
    found: Figures = {"record": record.name, "samples": len(record.pv), "orders": SPACE.orders}
    for name, v in (("one_parameter", record.one), ("two_parameter", record.two)):
        bench.tell(f"search: {name}")
        found[name] = _search(record.pv, v)
    orders = PEER_ORDERS[: bench.sizes.peer_orders] if bench.sizes.peer_orders < 4 else PEER_ORDERS
    found["ours_refined"] = _ours(record, orders)
    for name, fit in (("statsmodels", _statsmodels), ("sippy", _sippy)):
        bench.tell(f"search: {name}")
        found[name] = _peer(record, orders, fit, found)
    return found


def _record(bench: Bench) -> Record:
    path = None if bench.recordings is None else bench.recordings / "CHEM1.csv"
    if path is not None and path.is_file():
        recording = read_recordings(path).recordings[0]
        return _scaled("FC145 (CHEM1)", recording.pv, recording.op)
    loop = next(records(1, 1500))
    return _scaled("a simulated loop of 1,500 samples (no recording of FC145 beside the project)", loop.pv, loop.op)


def _scaled(name: str, pv: FloatArray, op: FloatArray) -> Record:
    pv, op = ((x - x.mean()) / x.std() for x in (pv, op))
    S, share = (x.ravel() for x in np.meshgrid(np.linspace(0.04, 0.8, 20), np.linspace(0.0, 1.0, 5), indexing="ij"))
    span = float(np.ptp(op))
    one = one_parameter(op, np.linspace(0.0, 0.58, 30) * span)
    return Record(name, pv, one, two_parameter_he(op, S * span, share * S * span))


def _search(pv: FloatArray, v: FloatArray) -> Figures:
    seconds = median_s(lambda: search_orders(pv, v, SPACE), 15)
    search = search_orders(pv, v, SPACE)
    needed = _products(search.long_order, len(v)) * len(pv)
    limit_s = needed / _products_a_second()
    fits = len(v) * SPACE.orders
    return {
        "points": len(v),
        "fits": fits,
        "ms": 1e3 * seconds,
        "us_a_fit": 1e6 * seconds / fits,
        "gram_limit_ms": 1e3 * limit_s,
        "times_the_limit": seconds / limit_s,
        "first_sample": search.first_sample,
    }


def _products(p: int, points: int) -> int:
    """Products a sample that the Gram matrices need at least: each distinct pair of lags once."""
    return points * (3 * p + 1 + 3 * SPACE.nc_max + SPACE.na_max + SPACE.nb_max)


def _products_a_second() -> float:
    """What one core reaches in a matrix product, from matrices too small for BLAS to share among threads."""
    a, b = np.random.default_rng(0).normal(size=(2, 64, 64))
    return 100 * 64**3 / median_s(lambda: [a @ b for _ in range(100)])


def _bands(record: Record) -> tuple[int, ...]:
    """No stiction, a small band and a large one."""
    return (0, len(record.one) // 4, len(record.one) // 2)


def _ours(record: Record, orders: tuple[Order, ...]) -> Figures:
    """An exact fit of ours of each order, for what a peer's single fit does."""
    aic = {}
    for order in orders:
        for band in _bands(record):
            aic[_key(order, band)] = refine(record.pv, record.one[band], order).aic_log
    ms = 1e3 * float(np.mean([median_s(partial(refine, record.pv, record.one[0], order), 5) for order in orders]))
    return {"ms_a_fit": ms, "aic": aic}


def _key(order: Order, band: int) -> str:
    return f"{order.na}/{order.nb}/{order.nc}@{band}"


def _peer(record: Record, orders: tuple[Order, ...], fit: Fit, found: Figures) -> Figures:
    seconds: dict[str, float] = {}
    aic: dict[str, float] = {}
    try:
        for order in orders:
            for band in _bands(record):
                start = time.thread_time()
                with _quiet():
                    aic[_key(order, band)] = fit(record.pv, record.one[band], order, found["one_parameter"]["fits"])
                seconds[_key(order, band)] = time.thread_time() - start
    except SkippedError as error:
        return {"skipped": str(error)}
    mean_s = float(np.mean(list(seconds.values())))
    ours = found["ours_refined"]
    return {
        "s_a_fit": mean_s,
        "fits": len(seconds),
        "search_would_take_h": mean_s * found["one_parameter"]["fits"] / 3600,
        "ratio_to_the_search": 1e6 * mean_s / found["one_parameter"]["us_a_fit"],
        "ratio_to_our_exact_fit": 1e3 * mean_s / ours["ms_a_fit"],
        **_agreement(orders, _bands(record), aic, ours["aic"]),
    }


def _agreement(
    orders: tuple[Order, ...], bands: tuple[int, ...], theirs: dict[str, float], ours: dict[str, float]
) -> dict[str, Any]:
    """Whether both choose the same order for each band, and the same band for each order; and where not, by how much
    N times our criterion the two winners differ."""
    same = 0
    apart: list[dict[str, object]] = []
    groups = [[_key(order, band) for order in orders] for band in bands]
    groups += [[_key(order, band) for band in bands] for order in orders]
    for group in groups:
        known = [key for key in group if math.isfinite(theirs[key])]
        if not known:
            apart.append({"group": group[0], "why": "no fit of the peer's converged"})
            continue
        chosen, our = min(known, key=theirs.__getitem__), min(known, key=ours.__getitem__)
        if chosen == our:
            same += 1
        else:
            apart.append({"theirs": chosen, "ours": our, "our_aic_gap": ours[chosen] - ours[our]})
    return {"choices": len(groups), "choices_alike": same, "apart": apart}


def _statsmodels(pv: FloatArray, v: FloatArray, order: Order, _: int) -> float:
    """Its exact maximum likelihood: a regression on the lags with errors MA(nc); AIC a sample."""
    from statsmodels.tsa.statespace.sarimax import SARIMAX

    first = max(order.na, order.nb)
    v = v - v.mean()
    lags = [pv[first - i : len(pv) - i] for i in range(1, order.na + 1)]
    lags += [v[first - j : len(v) - j] for j in range(1, order.nb + 1)]
    model = SARIMAX(pv[first:], exog=np.column_stack(lags), order=(0, 0, order.nc), concentrate_scale=True)
    return float(model.fit(disp=0).aic) / len(pv)


def _sippy(pv: FloatArray, v: FloatArray, order: Order, _: int) -> float:
    """Its iterative least squares (ILLS); Ljung's criterion from the variance of the errors that it states."""
    try:
        from sippy_unipi import system_identification
    except ImportError as error:
        raise SkippedError(f"sippy-unipi is not installed ({error}): pip install -r requirements-bench.lock") from error
    found = system_identification(
        pv, v - v.mean(), "ARMAX", ARMAX_orders=[order.na, order.nb, order.nc, 0], ARMAX_mod="ILLS"
    )
    return float(np.log(float(found.Vn)) + 2 * order.parameters / len(pv))


@contextmanager
def _quiet() -> Iterator[None]:
    """Peers print and warn about what they could not fit."""
    with warnings.catch_warnings(), redirect_stdout(StringIO()), redirect_stderr(StringIO()), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        os.environ.setdefault("OMP_NUM_THREADS", "1")
        yield
