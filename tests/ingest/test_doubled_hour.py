"""Hourly samples over the hour that comes twice in autumn."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from app.ingest import IngestOptions
from app.ingest.times.doubled_hour import hours_apart
from app.nanoseconds import NS_PER_H

from .conftest import Read

Layout = Callable[[list[tuple[int, str]]], str]
BERLIN = IngestOptions(time_zone="Europe/Berlin")
TIMES = [datetime(2026, 10, 24, 12, tzinfo=UTC) + timedelta(hours=i) for i in range(36)]
AT = np.array([time.replace(tzinfo=None) for time in TIMES], dtype="datetime64[ns]").astype(np.int64)
STAMPS = [f"{time.astimezone(ZoneInfo('Europe/Berlin')):%Y-%m-%d %H:%M:%S}" for time in TIMES]
ROWS = list(enumerate(STAMPS))


def wide(rows: list[tuple[int, str]]) -> str:
    return "Time,A.PV,A.OP\n" + "".join(f"{stamp},{i},1{i:02d}\n" for i, stamp in rows)


def by_time(rows: list[tuple[int, str]]) -> str:
    return "Tag,Time,Value\n" + "".join(f"A.PV,{stamp},{i}\nA.OP,{stamp},1{i:02d}\n" for i, stamp in rows)


def by_tag(rows: list[tuple[int, str]]) -> str:
    pv = "".join(f"A.PV,{stamp},{i}\n" for i, stamp in rows)
    return f"Tag,Time,Value\n{pv}" + "".join(f"A.OP,{stamp},1{i:02d}\n" for i, stamp in rows)


@pytest.mark.parametrize("layout", [wide, by_time, by_tag])
@pytest.mark.parametrize("rows", [ROWS, ROWS[::-1], ROWS[12:], ROWS[:14]], ids=["whole", "newest", "begins", "ends"])
def test_no_row_is_lost(read: Read, layout: Layout, rows: list[tuple[int, str]]) -> None:
    content = read(layout(rows), options=BERLIN)
    loop = content.loops["A"]
    numbers = sorted(i for i, _ in rows)
    np.testing.assert_array_equal(loop.time_ns, AT[numbers])
    assert loop.pv.tolist() == numbers
    assert loop.op.tolist() == [100 + i for i in numbers]
    assert content.rejects.total == 0


@pytest.mark.parametrize("layout", [wide, by_time])
def test_a_row_that_comes_twice_elsewhere_is_a_duplicate(read: Read, layout: Layout) -> None:
    content = read(layout([*ROWS[:20], (99, STAMPS[19]), *ROWS[20:]]), options=BERLIN)
    assert content.loops["A"].samples == 36
    assert content.rejects.counts["duplicate_time"] == 2


def test_half_hourly_samples_of_a_zone_whose_clock_is_put_back_by_half_an_hour(read: Read) -> None:
    zone = ZoneInfo("Australia/Lord_Howe")
    times = [datetime(2026, 4, 4, 10, tzinfo=UTC) + timedelta(minutes=30 * i) for i in range(20)]
    rows = [(i, f"{time.astimezone(zone):%Y-%m-%d %H:%M:%S}") for i, time in enumerate(times)]
    content = read(wide(rows), options=IngestOptions(time_zone="Australia/Lord_Howe"))
    at = np.array([time.replace(tzinfo=None) for time in times], dtype="datetime64[ns]").astype(np.int64)
    np.testing.assert_array_equal(content.loops["A"].time_ns, at)
    assert content.rejects.total == 0


def test_where_both_passes_are_known_already(read: Read) -> None:
    twice = NS_PER_H * np.array([0, 1, 2, 3, 3, 4, 5])
    assert hours_apart(AT[9] + twice, "Europe/Berlin").tolist() == (AT[9] + twice).tolist()
    assert hours_apart(AT[9] + twice, "UTC").tolist() == (AT[9] + twice).tolist()


CAME_TWICE = "an hour of rows came twice: if it is the one that a clock shows twice in autumn"


def notes_of_the_hour(read: Read, text: str, zone: str) -> list[str]:
    content = read(text, options=IngestOptions(time_zone=zone))
    return [note for note in content.summary.notes if note.startswith(CAME_TWICE)]


@pytest.mark.parametrize("layout", [wide, by_time, by_tag])
@pytest.mark.parametrize("zone", ["UTC", "Asia/Tokyo"])
def test_where_no_zone_is_named_the_hour_is_told(read: Read, layout: Layout, zone: str) -> None:
    assert len(notes_of_the_hour(read, layout(ROWS), zone)) == 1
    assert not notes_of_the_hour(read, layout(ROWS), "Europe/Berlin")


@pytest.mark.parametrize("layout", [wide, by_time, by_tag])
def test_a_row_that_comes_twice_at_noon_is_no_such_hour(read: Read, layout: Layout) -> None:
    once = [(i, stamp) for i, stamp in ROWS if i != 13]
    noon = next(at for at, (_, stamp) in enumerate(once) if "25 12:00" in stamp)
    assert not notes_of_the_hour(read, layout([*once[:noon], (99, once[noon][1]), *once[noon:]]), "UTC")
