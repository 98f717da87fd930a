"""A loop's series, thinned to what a screen shows."""

from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from app.errors import RequestError
from app.ingest import carried
from app.services.backend import Backend
from app.services.moments import iso_utc, moment_of
from app.services.plant.loops import find
from app.services.results import TrendView
from app.storage import series
from app.storage.samples import FloatArray, Samples

MOST_POINTS = 10_000
NS_PER_S = 1_000_000_000
DEFAULT_S = 24 * 3600
FARTHEST_S = 9_000_000_000  # the years 1684 to 2255: nanoseconds of them, and DEFAULT_S before them, fit into 64 bits


def trend(
    backend: Backend, tag: str, points: int = 1000, start: datetime | None = None, end: datetime | None = None
) -> TrendView:
    """PV, OP and SP between `start` and `end`, by default the newest 24 hours; about `points` times.

    Of each stretch the least and the greatest value of each signal are kept, so that no peak is lost.
    """
    if not 2 <= points <= MOST_POINTS:
        raise RequestError("bad_points", f"points must be from 2 to {MOST_POINTS}, got {points}")
    row = find(backend, tag)
    if row.newest_ns is None:
        return TrendView(tag, 0, [], [], [], None)
    end_ns = row.newest_ns if end is None else instant_ns(end)
    start_ns = end_ns - DEFAULT_S * NS_PER_S if start is None else instant_ns(start)
    with backend.database.read() as connection:
        samples = series.between(connection, row.id, start_ns, end_ns, backend.settings.hold_days)
    return _thinned(tag, samples, points) if samples is not None else TrendView(tag, 0, [], [], [], None)


def _thinned(tag: str, samples: Samples, points: int) -> TrendView:
    n = len(samples)
    sp = samples.signals.get("sp")
    shown = [samples.signals.get("pv"), samples.signals.get("op"), None if sp is None else carried(sp)]
    kept = np.arange(n) if n <= points else extremes([s for s in shown if s is not None], n, points)
    time = [iso_utc(moment_of(int(t))) or "" for t in samples.time_ns[kept]]
    pv, op, set_point = (None if signal is None else numbers(signal[kept]) for signal in shown)
    missing: list[float | None] = [None] * len(kept)
    time_ms: list[int] = (samples.time_ns[kept] // 1_000_000).tolist()
    held = {name: iso_utc(moment_of(samples.held_ns[name])) for name in samples.held_ns}
    return TrendView(
        tag, n, time, pv or missing, op or missing, set_point, time_ms, held.get("sp"), held.get("automatic")
    )


def extremes(signals: list[FloatArray], n: int, points: int) -> NDArray[np.int64]:
    """Where each signal is least and greatest in each of the stretches into which the samples are cut."""
    buckets = max(1, points // (2 * max(1, len(signals))))
    edges = np.linspace(0, n, buckets + 1).astype(np.int64)
    width = int(np.max(np.diff(edges)))
    # The last column repeats samples of the next stretch where a stretch is one shorter; repeated places fall away.
    places = np.minimum(edges[:-1, None] + np.arange(width)[None, :], n - 1)
    rows = np.arange(buckets)
    found = [np.zeros(1, np.int64), np.full(1, n - 1)]
    for signal in signals:
        values = signal[places]
        found.append(places[rows, np.argmin(np.where(np.isnan(values), np.inf, values), axis=1)])
        found.append(places[rows, np.argmax(np.where(np.isnan(values), -np.inf, values), axis=1)])
    return np.unique(np.concatenate(found))


def numbers(values: FloatArray) -> list[float | None]:
    return [None if np.isnan(value) else float(value) for value in values]


def instant_ns(moment: datetime) -> int:
    """Instants beyond what a sample's time can hold are its ends: nothing lies outside of them anyway."""
    aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    seconds = (aware - datetime.fromtimestamp(0, UTC)).total_seconds()
    return round(max(-FARTHEST_S, min(FARTHEST_S, seconds)) * NS_PER_S)
