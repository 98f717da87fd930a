"""A loop's series, thinned to what a screen shows."""

import logging
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
from threading import BoundedSemaphore

import numpy as np

from app.engine.signals.extremes import extremes
from app.errors import DataError, RequestError
from app.ingest import carried
from app.nanoseconds import NS_PER_S
from app.services.audit_json.numbers import listed
from app.services.backend import Backend
from app.services.loops import find
from app.services.moments import iso_utc, latest_ns, moment_of, ns_of
from app.services.outward import TrendOut
from app.storage import series
from app.storage.samples import DamagedStretchError, Samples, merged
from app.storage.steps import HOLDING

log = logging.getLogger("loopaudit.trend")

MOST_POINTS = 10_000
PIECE_SAMPLES = 200_000  # that are read at once: some 40 MB
PIECES_AT_ONCE = 4
"""In this process, for all who ask: a dashboard asks for a dozen trends of months at a time."""
FINER = 4
DEFAULT_S = 24 * 3600

_reading = BoundedSemaphore(PIECES_AT_ONCE)


def trend(
    backend: Backend, tag: str, points: int = 1000, start: datetime | None = None, end: datetime | None = None
) -> TrendOut:
    """PV, OP, SP and mode between `start` and `end`, by default the newest 24 hours, without samples ahead of the clock
    where there are others; at most `points` times.

    Of each stretch the least and the greatest value of each signal are kept, so that no peak is lost; where so few
    points have no room for all signals, those of PV first, then of OP. Raises DataError("damaged_samples") where what
    is stored cannot be read.
    """
    if not 2 <= points <= MOST_POINTS:
        raise RequestError("bad_points", f"points must be from 2 to {MOST_POINTS}, got {points}")
    row = find(backend, tag)
    if row.newest_ns is None:
        return _nothing(tag)
    end_ns = _newest_ns(backend, row.id, row.newest_ns) if end is None else ns_of(end)
    start_ns = end_ns - DEFAULT_S * NS_PER_S if start is None else ns_of(start)
    try:
        found = _stretch(backend, row.id, start_ns, end_ns, points)
    except DamagedStretchError as error:
        log.exception("the trend of %r cannot be drawn", tag)
        raise DataError("damaged_samples", f"{error}; ask for a time before or after it") from error
    return _nothing(tag) if found is None else _view(tag, *found, points)


def _nothing(tag: str) -> TrendOut:
    return TrendOut(tag, 0, [], [], [], [], None, None, None)


def _newest_ns(backend: Backend, loop_id: int, newest_ns: int) -> int:
    with backend.database.read() as connection:
        return series.newest_before(connection, loop_id, newest_ns, latest_ns())


def _stretch(backend: Backend, loop_id: int, start_ns: int, end_ns: int, points: int) -> tuple[Samples, int] | None:
    """What is shown from `start_ns` to `end_ns`, and how many samples that is of. A long stretch is read piece by
    piece, and of each more points are kept than are asked for: a year of seconds has a gigabyte."""
    hold_days = backend.settings.hold_days
    with backend.database.read() as connection:
        bounds = series.pieces(connection, loop_id, start_ns, end_ns, PIECE_SAMPLES)
    kept: list[Samples] = []
    n, held = 0, dict.fromkeys(HOLDING, np.nan)
    for first_ns, last_ns in bounds:
        with _reading:
            with backend.database.read() as connection:
                samples = series.between(connection, loop_id, first_ns, last_ns, hold_days)
            if samples is None or not len(samples):
                continue
            shown = _shown(samples, held)
            n, held = n + len(shown), {name: _last(shown, name) for name in HOLDING}
            finer = max(points, FINER * points * len(shown) // PIECE_SAMPLES)
            kept.append(shown if len(bounds) == 1 else _thinned(shown, finer))
            del samples, shown  # not held while the next piece is waited for
    return (replace(merged(kept), held_ns=kept[0].held_ns), n) if kept else None


def _shown(samples: Samples, held: Mapping[str, float]) -> Samples:
    """PV, OP, and SP and mode as they hold; held: the last ones before, NaN where none is known."""
    shown = {name: samples.signals[name] for name in ("pv", "op", *HOLDING) if name in samples.signals}
    for name, last in held.items():
        if name in shown or np.isfinite(last):
            stated = shown.get(name, np.full(len(samples), np.nan))
            shown[name] = carried(np.append(last, stated))[1:]
    return replace(samples, signals=shown)


def _last(samples: Samples, name: str) -> float:
    return float(samples.signals[name][-1]) if name in samples.signals else np.nan


def _thinned(samples: Samples, points: int) -> Samples:
    """A mode that stays takes no points from the other signals."""
    n = len(samples)
    drawn = [values for name, values in samples.signals.items() if name != "automatic" or np.ptp(values) != 0]
    return samples if n <= points else samples.part(extremes(drawn, n, points))


def _view(tag: str, samples: Samples, n: int, points: int) -> TrendOut:
    shown = _thinned(samples, points)
    time = [iso_utc(moment_of(int(t))) or "" for t in shown.time_ns]
    signals = {name: listed(values) for name, values in shown.signals.items()}
    missing: list[float | None] = [None] * len(shown)
    time_ms: list[int] = (shown.time_ns // 1_000_000).tolist()
    held = {name: iso_utc(moment_of(samples.held_ns[name])) for name in samples.held_ns}
    return TrendOut(
        tag,
        n,
        time,
        time_ms,
        signals.get("pv", missing),
        signals.get("op", missing),
        signals.get("sp"),
        held.get("sp"),
        held.get("automatic"),
        _known_modes(signals.get("automatic")),
    )


def _known_modes(modes: list[float | None] | None) -> list[int | None] | None:
    """1 and 0; -1 is a mode that was not understood."""
    if modes is None:
        return None
    return [None if mode is None or mode < 0 else int(mode) for mode in modes]
