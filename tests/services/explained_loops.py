"""Loops whose explanations are tested: an OP that wanders, a first order behind it, and what was recorded of them."""

from datetime import UTC, datetime
from typing import Any

import numpy as np

from app.services.backend import Backend
from app.services.explaining.explanations import Wanted
from app.services.explaining.simulations import GivenSimulation
from app.storage import loops, series
from app.storage.samples import Samples
from app.storage.series import Stretch

N, INTERVAL_S = 400, 10
START = datetime(2026, 3, 1, tzinfo=UTC)
START_NS = int(START.timestamp()) * 1_000_000_000
GAIN, TAU_S = 0.8, 60.0

Signals = dict[str, np.ndarray]


def linear(op: np.ndarray) -> np.ndarray:
    """First order by hand: what the loop below would show without its missing physics."""
    pv = np.empty(len(op))
    pv[0] = 40.0
    a = np.exp(-INTERVAL_S / TAU_S)
    for k in range(1, len(op)):
        pv[k] = a * pv[k - 1] + (1.0 - a) * (40.0 + GAIN * (op[k - 1] - 50.0))
    return pv


def record(step: float = 0.0, n: int = N) -> Signals:
    """OP wanders, PV follows it, and from the middle on the sensor shows `step` more."""
    rng = np.random.default_rng(7)
    op = 50.0 + np.repeat(rng.normal(0.0, 4.0, -(-n // 25)), 25)[:n] + rng.normal(0.0, 0.3, n)
    pv = linear(op) + rng.normal(0.0, 0.1, n) + step * (np.arange(n) >= n // 2)
    return {"pv": pv, "op": op}


def keep(backend: Backend, tag: str, signals: Signals, start_ns: int = START_NS) -> None:
    times = start_ns + np.arange(len(signals["pv"])) * INTERVAL_S * 1_000_000_000
    with backend.database.write() as connection:
        ids = loops.ensure(connection, [tag])
        series.add(connection, [Stretch(ids[tag], Samples(times, signals))], None)


def model(**told: Any) -> Wanted:
    return Wanted(simulation=GivenSimulation(model=told))
