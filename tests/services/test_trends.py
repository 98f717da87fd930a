"""Trends: what of a record is drawn, by the piece, and what of SP and mode holds in it."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import numpy as np
import pytest
from sqlalchemy import update

from app.errors import DataError
from app.services.backend import Backend
from app.services.plant import trend as trends
from app.services.plant.trend import trend
from app.storage import loops as stored_loops
from app.storage import series
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import series as stored_series
from tests.services.upkeep_plant import with_settings

AddLoops = Callable[..., dict[str, int]]


def test_a_trend_keeps_the_extremes(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", n=1400)
    whole, thinned = trend(backend, "FIC1", points=5000), trend(backend, "FIC1", points=100)
    assert (whole.samples, len(whole.time), thinned.samples) == (1400, 1400, 1400)
    assert 20 < len(thinned.time) <= 100
    assert (max(thinned.pv), min(thinned.op)) == (max(whole.pv), min(whole.op))
    assert (thinned.time[0], thinned.time[-1]) == (whole.time[0], whole.time[-1])
    assert whole.sp is None
    start = datetime(2025, 6, 15, 15, 10, tzinfo=UTC)
    part = trend(backend, "FIC1", start=start, end=datetime(2025, 6, 15, 15, 20, tzinfo=UTC))
    assert part.samples == 10
    assert np.isfinite(part.pv).all()


@pytest.mark.parametrize("points", [2, 3, 5, 7, 8, 9, 61, 399, 1399])
def test_a_trend_has_no_more_points_than_are_asked_for(backend: Backend, add_loops: AddLoops, points: int) -> None:
    add_loops("FIC1", n=1400)
    whole, thinned = trend(backend, "FIC1", points=5000), trend(backend, "FIC1", points=points)
    assert points / 3 < len(thinned.time) <= points
    assert (thinned.time[0], thinned.time[-1]) == (whole.time[0], whole.time[-1])
    assert thinned.time_ms == sorted(set(thinned.time_ms))


@pytest.mark.parametrize("points", [4, 5, 7, 9, 10, 400])
def test_the_peak_of_pv_is_seen_however_few_points_are_asked_for(
    backend: Backend, add_loops: AddLoops, points: int
) -> None:
    add_loops("FIC1", n=1400)
    whole, thinned = trend(backend, "FIC1", points=5000), trend(backend, "FIC1", points=points)
    assert len(thinned.time) <= points
    assert max(thinned.pv) == max(whole.pv)
    assert whole.time[whole.pv.index(max(whole.pv))] == thinned.time[thinned.pv.index(max(thinned.pv))]


def test_a_sample_ahead_of_the_clock_moves_no_trend(backend: Backend, add_loops: AddLoops) -> None:
    """Its newest day was that of a stamp of the year 2033, of one sample, and the record was not to be seen."""
    add_loops("FIC1", n=1400)
    before = trend(backend, "FIC1", points=5000)
    with backend.database.write() as connection:
        stray = Samples(np.array([2_000_000_000 * 10**9]), {"pv": np.ones(1), "op": np.ones(1)})
        loop_id = stored_loops.ensure(connection, ["FIC1"])["FIC1"]
        series.add(connection, [Stretch(loop_id, stray)], None)
    assert trend(backend, "FIC1", points=5000) == before
    late = trend(backend, "FIC1", start=datetime(2033, 1, 1, tzinfo=UTC), end=datetime(2034, 1, 1, tzinfo=UTC))
    assert late.samples == 1, "what is asked for is shown"


def test_a_trend_of_damaged_samples_is_refused_with_a_code(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", n=150)
    with backend.database.write() as connection:
        connection.execute(update(stored_series).values(packed=b"damaged"))
    with pytest.raises(DataError, match="cannot be read") as refused:
        trend(backend, "FIC1")
    assert refused.value.code == "damaged_samples"


def test_a_trend_has_the_mode_as_it_holds(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    """In manual for a moment, then in a mode of which nobody knows what it means; stored when it changes."""
    n = 1400
    mode = np.full(n, np.nan)
    mode[[3, 700, 701, 1300]] = 1.0, 0.0, 1.0, -1.0
    seconds = 1_750_000_000 + np.arange(n)
    signals = {"pv": np.sin(seconds / 9), "op": np.cos(seconds / 9), "automatic": mode}
    with backend.database.write() as connection:
        loop_id = stored_loops.ensure(connection, ["FIC1"])["FIC1"]
        for part in (slice(0, 500), slice(500, n)):
            cut = {name: values[part] for name, values in signals.items()}
            series.add(connection, [Stretch(loop_id, Samples(seconds[part] * 10**9, cut))], None)
    shown = trend(backend, "FIC1", points=5000)
    assert shown.automatic == [None] * 3 + [1] * 697 + [0] + [1] * 599 + [None] * 100
    assert 0 in trend(backend, "FIC1", points=60).automatic
    monkeypatch.setattr(trends, "PIECE_SAMPLES", 600)
    assert trend(backend, "FIC1", points=5000) == shown


def test_a_mode_that_stays_takes_no_points_from_the_others(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", n=1400)
    alone = trend(backend, "FIC1", points=100)
    assert alone.automatic is None
    with backend.database.write() as connection:
        loop_id = stored_loops.ensure(connection, ["FIC1"])["FIC1"]
        stamps = series.between(connection, loop_id, 0, 2**62).time_ns
        series.add(connection, [Stretch(loop_id, Samples(stamps, {"automatic": np.ones(1400)}))], None)
    found = trend(backend, "FIC1", points=100)
    assert (found.time, found.automatic) == (alone.time, [1] * len(alone.time))


def long_record(backend: Backend, days: int = 5, lines: int = 200) -> None:
    """A loop whose stretches overlap, with values that were corrected, and whose SP was stated once."""
    with backend.database.write() as connection:
        loop_id = stored_loops.ensure(connection, ["FIC1"])["FIC1"]
        for day in range(days):
            seconds = 1_750_000_000 + 150 * day + np.arange(lines)
            pv = np.sin(seconds / 9) + np.where(np.arange(lines) == 77, 10 + day, 0)
            sp = np.where(np.arange(lines) == 20, 50.0 + day, np.nan)
            signals = {"pv": pv, "op": np.cos(seconds / 9)} | ({"sp": sp} if day in (0, 2) else {})
            series.add(connection, [Stretch(loop_id, Samples(seconds * 10**9, signals))], None)


def test_a_long_trend_is_read_piece_by_piece(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    long_record(backend)
    whole, thinned = trend(backend, "FIC1", points=2000), trend(backend, "FIC1", points=60)
    read: list[int] = []
    between = series.between

    def counted(*arguments: Any) -> Samples | None:
        samples = between(*arguments)
        read.append(0 if samples is None else len(samples))
        return samples

    monkeypatch.setattr(series, "between", counted)
    monkeypatch.setattr(trends, "PIECE_SAMPLES", 250)
    assert trend(backend, "FIC1", points=2000) == whole
    assert (len(read), sum(read), max(read) <= 250) == (5, 800, True)
    assert whole.samples == 800
    assert (whole.sp[19], whole.sp[20], whole.sp[319:321], whole.sp[-1]) == (None, 50.0, [50.0, 52.0], 52.0)
    in_pieces = trend(backend, "FIC1", points=60)
    assert in_pieces.samples == 800
    assert 20 < len(in_pieces.time) <= len(thinned.time) + 6
    assert (in_pieces.time[0], in_pieces.time[-1]) == (whole.time[0], whole.time[-1])
    assert [(min(s), max(s)) for s in (in_pieces.pv, in_pieces.op)] == [(min(s), max(s)) for s in (whole.pv, whole.op)]


def test_a_set_point_holds_from_piece_to_piece_for_longer_than_before_a_stretch(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    long_record(backend)
    soon_forgotten = with_settings(backend, hold_days=30 / 86_400)
    whole = trend(soon_forgotten, "FIC1", points=2000)
    assert (whole.sp[19], whole.sp[319:321], whole.sp[-1]) == (None, [50.0, 52.0], 52.0)
    monkeypatch.setattr(trends, "PIECE_SAMPLES", 250)
    assert trend(soon_forgotten, "FIC1", points=2000) == whole


def test_a_trend_from_and_to_the_stamp_of_a_sample_holds_it(backend: Backend) -> None:
    """In floats a bound was up to 100 ns off, and the sample that was named was left out."""
    start_ns = 1_769_828_400_007_000_000  # 2026-01-31T03:00:00.007Z
    with backend.database.write() as connection:
        ids = stored_loops.ensure(connection, ["FIC1"])
        samples = Samples(start_ns + 1_237_000_000 * np.arange(40), {"pv": np.arange(40.0)})
        series.add(connection, [Stretch(ids["FIC1"], samples)], None)
    stamps = [datetime.fromisoformat(stamp) for stamp in trend(backend, "FIC1").time]
    assert [trend(backend, "FIC1", start=stamp, end=stamp).pv for stamp in stamps] == [[k] for k in range(40)]


def test_a_trend_of_any_instants_is_told(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("FIC1", n=150)
    first, last = datetime.min.replace(tzinfo=timezone(timedelta(hours=14))), datetime.max.replace(tzinfo=UTC)
    assert trend(backend, "FIC1", start=first, end=last).samples > 0
    assert trend(backend, "FIC1", start=last).samples == 0
    assert trend(backend, "FIC1", end=first).samples == 0


def test_few_pieces_of_long_trends_are_in_memory_at_a_time(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    """A dashboard asks for a dozen trends of months at a time, and each took what a million samples take."""
    long_record(backend)
    monkeypatch.setattr(trends, "PIECE_SAMPLES", 250)
    between, lock = series.between, threading.Lock()
    inside: list[int] = []
    most: list[int] = []

    def counted(*arguments: Any) -> Samples | None:
        with lock:
            inside.append(1)
            most.append(len(inside))
        time.sleep(0.02)
        with lock:
            inside.pop()
        return between(*arguments)

    monkeypatch.setattr(series, "between", counted)
    with ThreadPoolExecutor(8) as pool:
        shown = list(pool.map(lambda _: trend(backend, "FIC1", points=60).samples, range(8)))
    assert shown == [800] * 8
    assert max(most) == trends.PIECES_AT_ONCE
