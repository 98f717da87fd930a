"""A plant whose loops are held by their controllers until the PV of some comes to stand, and their OPs wind up."""

from collections.abc import Mapping

import numpy as np
from sqlalchemy import Connection

from app.services.backend import Backend
from app.storage import loops, series
from app.storage.samples import Samples
from app.storage.series import Stretch

SAMPLES, INTERVAL_S = 1400, 60.0
START_NS = 1_750_000_000_000_000_000
MINUTE_NS = 60_000_000_000
SPANS = {"pv_low": 0.0, "pv_high": 100.0, "op_low": 0.0, "op_high": 100.0}


def record(seed: int, stands_from: int | None = None, first: int = 0) -> Samples:
    """A loop at 50 with a load that comes and goes; stands_from: the minute from which PV stands, away from SP, and OP
    runs to its limit. first: the minute that the record begins with."""
    rng, k = np.random.default_rng(seed), np.arange(SAMPLES)
    slow = 2.0 * np.pi * k / rng.uniform(90.0, 150.0)
    op = np.round(48.0 + 2.0 * np.sin(slow) + 0.1 * rng.standard_normal(SAMPLES), 2)
    pv = np.round(50.0 + 0.3 * np.sin(slow + 1.0) + 0.1 * rng.standard_normal(SAMPLES), 2)
    if stands_from is not None:
        at = max(stands_from - first, 0)
        pv[at:] = 50.7
        op[at:] = np.round(np.maximum(op[at] * (1.0 - (k[at:] - at + max(first - stands_from, 0)) / 100.0), 0.0), 2)
    signals = {"pv": pv, "op": op, "sp": np.full(SAMPLES, 50.0), "automatic": np.ones(SAMPLES)}
    return Samples(START_NS + (first + k) * MINUTE_NS, signals)


def stored(backend: Backend, stands_from: Mapping[str, int | None], units: Mapping[str, str]) -> dict[str, int]:
    """Loops by tag, with the minute from which each stands (None: it is at work) and the unit that it is of."""
    with backend.database.write() as connection:
        ids = loops.ensure(connection, tuple(stands_from))
        _add(connection, ids, stands_from)
        for tag, loop_id in ids.items():
            loops.change(connection, loop_id, {"unit": units.get(tag), **SPANS})
    return ids


def later(backend: Backend, stands_from: Mapping[str, int | None], first: int) -> None:
    """What is recorded of them later on, from the minute `first` on."""
    with backend.database.write() as connection:
        _add(connection, loops.ids_of(connection, list(stands_from)), stands_from, first)


def _add(connection: Connection, ids: Mapping[str, int], stands_from: Mapping[str, int | None], first: int = 0) -> None:
    made = [(tag, record(seed, at, first)) for seed, (tag, at) in enumerate(stands_from.items())]
    series.add(connection, [Stretch(ids[tag], samples) for tag, samples in made], None)
