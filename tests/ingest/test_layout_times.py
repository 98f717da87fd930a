"""Times as exports write them: forms, orders of day and month, zones, counted times, stamps that are cut."""

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions
from app.ingest.model import NO_TIME
from app.ingest.times.stamps import TimeForm
from app.ingest.times.time_reader import TimeReader

from .conftest import Read

MINUTE = 60 * 10**9
START = np.datetime64("2024-03-01T00:00:00", "ns").astype(np.int64)
MINUTES = [f"13/07/24 0:{44 + i // 60},6.5,{i},25\n" for i in range(600)]


def test_recording_in_seconds_is_anchored_so_that_sending_again_gives_the_same(read: Read) -> None:
    text = "time,SP,PV,OP\n0,50,51.5,40\n0.2,50,51.6,41\n0.4,,51.7,42\n"
    content = read(text, name="CHEM99.csv")
    loop = content.loops["CHEM99"]
    assert loop.time_ns.tolist() == [0, 200_000_000, 400_000_000]
    np.testing.assert_array_equal(loop.sp, [50, 50, np.nan])
    moved = read(text, name="CHEM99.csv", options=IngestOptions(start_ns=int(START)))
    assert moved.loops["CHEM99"].time_ns[0] == START


def test_rows_that_were_sent_twice_are_no_cut_stamps(read: Read) -> None:
    rows = [f"2024-01-01 00:{k // 60:02d}:{k % 60:02d},{50 + k % 7},{40 + k % 11}" for k in range(200)]
    content = read("\n".join(["time,FIC1.PV,FIC1.OP", *(row for row in rows for _ in range(2))]))
    assert not any("spread" in note for note in content.summary.notes)
    np.testing.assert_array_equal(np.diff(content.loops["FIC1"].time_ns), np.full(199, 10**9))


def test_minute_stamps_are_spread_by_the_order_of_rows(read: Read) -> None:
    rows = [f"13/07/24 0:{44 + (i + 20) // 60},6.5,{6 + i / 1000},25" for i in range(200)]
    content = read("Time,SP,PV,OP\n" + "\n".join(rows) + "\n", name="flow.csv")
    loop = content.loops["flow"]
    assert len(loop.time_ns) == 200
    np.testing.assert_array_equal(np.diff(loop.time_ns), 10**9)
    assert loop.time_ns[0] == np.datetime64("2024-07-13T00:44:20", "ns").astype(np.int64)
    assert any("spread" in note for note in content.summary.notes)
    assert any(note.startswith("dates were read day first") for note in content.summary.notes)


def test_day_and_month_are_told_apart_by_the_rows(read: Read) -> None:
    days = [f"0{day}/03/2024 00:00,1,2" for day in range(1, 8)]
    content = read("Time,A.PV,A.OP\n" + "\n".join(days) + "\n")
    steps = np.diff(content.loops["A"].time_ns)
    np.testing.assert_array_equal(steps, 86400 * 10**9)
    american = read("Time,A.PV,A.OP\n03/13/2024 00:00,1,2\n03/14/2024 00:00,1,2\n")
    assert american.loops["A"].time_ns[0] == np.datetime64("2024-03-13", "ns").astype(np.int64)


def test_what_the_first_day_leaves_open_the_last_one_tells(read: Read) -> None:
    stamps = [f"03/{1 + i // 1440:02d}/2024 {i // 60 % 24:02d}:{i % 60:02d}:00" for i in range(20 * 1440)]
    loop = read("Time,A.PV,A.OP\n" + "".join(f"{stamp},1.5,2.5\n" for stamp in stamps)).loops["A"]
    assert loop.time_ns[0] == START
    np.testing.assert_array_equal(np.diff(loop.time_ns), MINUTE)


def test_local_time_through_the_doubled_hour(read: Read) -> None:
    rows = "2024-10-27 01:30:00,1,1\n2024-10-27 02:30:00,2,2\n2024-10-27 02:30:00,3,3\n2024-10-27 03:30:00,4,4\n"
    half = "2024-10-27 02:00:00,1,1\n2024-10-27 02:30:00,2,2\n2024-10-27 02:00:00,3,3\n2024-10-27 02:30:00,4,4\n"
    options = IngestOptions(time_zone="Europe/Berlin")
    loop = read("Time,A.PV,A.OP\n" + half, options=options).loops["A"]
    assert np.diff(loop.time_ns).tolist() == [1800 * 10**9] * 3
    assert loop.time_ns[0] == np.datetime64("2024-10-27T00:00", "ns").astype(np.int64)
    assert read("Time,A.PV,A.OP\n" + rows, options=options).loops["A"].pv.tolist()[0] == 1


@pytest.mark.parametrize(
    ("stamp", "seconds"),
    [
        ("1709251200", 1709251200.0),
        ("1709251200000", 1709251200.0),
        ("1709251200000000000", 1709251200.0),
        ("2024-03-01T00:00:00Z", 1709251200.0),
        ("01.03.2024 00:00", 1709251200.0),
        ("1-Mar-24 00:00:00.5", 1709251200.5),
        ("3/1/2024 12:00:00 AM", 1709251200.0),
        ("20240301000000", 1709251200.0),
        ("2024/03/01 00:00:00.250", 1709251200.25),
        ("2024-03-01 02:00:00+02:00", 1709251200.0),
    ],
)
def test_forms_of_time(read: Read, stamp: str, seconds: float) -> None:
    loop = read(f"Time,A.PV,A.OP\n{stamp},1,2\n").loops["A"]
    assert loop.time_ns.tolist() == [round(seconds * 1000) * 10**6]


def test_minute_stamps_are_spread_across_chunks(read: Read) -> None:
    whole, parts = (
        read("Time,SP,PV,OP\n" + "".join(MINUTES), options=IngestOptions(chunk_bytes=size)).loops["export"]
        for size in (1 << 20, 4000)
    )
    np.testing.assert_array_equal(np.diff(parts.time_ns), 10**9)
    np.testing.assert_array_equal(parts.time_ns, whole.time_ns)
    assert parts.pv.tolist() == list(range(600))


def test_minute_stamps_that_go_back_are_sorted(read: Read) -> None:
    content = read("Time,SP,PV,OP\n" + "".join(MINUTES) + "13/07/24 0:44,6.5,99,25\n")
    loop = content.loops["export"]
    assert loop.samples == 600
    assert loop.pv[0] == 99
    assert dict(content.rejects.counts) == {"duplicate_time": 1}
    assert any("sorted" in note for note in content.summary.notes)


def test_days_since_1900(read: Read) -> None:
    rows = "".join(f"{45352 + i / 1440:.8f},{i},1\n" for i in range(4))
    loop = read("Date,A.PV,A.OP\n" + rows).loops["A"]
    np.testing.assert_allclose(loop.time_ns - START, MINUTE * np.arange(4), atol=10**6)


def test_days_since_1900_under_the_name_of_a_time(read: Read) -> None:
    rows = "".join(f"{45352 + i / 8640:.10f},{i},1\n" for i in range(4))
    content = read("time,A.PV,A.OP\n" + rows)
    np.testing.assert_allclose(content.loops["A"].time_ns - START, MINUTE // 6 * np.arange(4), atol=10**6)
    assert content.summary.notes == (
        "times are days since 1899-12-30, as spreadsheets count them: the first one is of 2024-03-01 "
        "(2028-03-02 where the workbook counts from 1904)",
    )


@pytest.mark.parametrize("first", ["1e300", "1e20", "1e12", "0", "-5", "nan"])
def test_the_first_date_is_told_of_the_first_row_that_has_one(read: Read, first: str) -> None:
    rows = "".join(f"{45352 + i / 8640:.10f},{i},1\n" for i in range(60))
    content = read(f"time,A.PV,A.OP\n{first},1,2\n{rows}")
    assert "the first one is of 2024-03-01 (2028-03-02 where" in content.summary.notes[0]
    assert content.rejects.counts == {"bad_time": 1}


@pytest.mark.parametrize("name", ["Time [s]", "time_s", "Time (sec)", "seconds", "Timestamp [s]"])
def test_seconds_by_their_name_are_no_days(read: Read, name: str) -> None:
    content = read(f"{name},A.PV,A.OP\n" + "".join(f"{30000 + i / 100:.2f},{i},1\n" for i in range(9)))
    np.testing.assert_allclose(np.diff(content.loops["A"].time_ns), 10**7, atol=1000)


@pytest.mark.parametrize("name", ["time_s", "time"])
def test_stamps_that_come_once_a_tag_are_no_days(read: Read, name: str) -> None:
    rows = "".join(f"{30000.5 + i},A.{signal},{i}\n" for i in range(9) for signal in ("PV", "OP", "SP"))
    loop = read(f"{name},tag,value\n" + rows).loops["A"]
    assert np.diff(loop.time_ns).tolist() == [10**9] * 8


@pytest.mark.parametrize(("unit", "nanoseconds"), [("ms", 10**6), ("min", MINUTE), ("h", 60 * MINUTE), ("us", 1000)])
def test_relative_times_in_the_unit_of_their_name(read: Read, unit: str, nanoseconds: int) -> None:
    content = read(f"Time [{unit}],A.PV,A.OP\n0,1,2\n1,2,3\n2,3,4\n")
    assert np.diff(content.loops["A"].time_ns).tolist() == [nanoseconds] * 2
    assert any(f"times are in {unit}" in note for note in content.summary.notes)


@pytest.mark.parametrize(("day_first", "days_apart"), [(True, 1), (False, 31)])
def test_the_order_of_day_and_month_can_be_said(read: Read, day_first: bool, days_apart: int) -> None:
    text = "Time,A.PV,A.OP\n03/04/2024 00:00,1,10\n04/04/2024 00:00,2,20\n"
    content = read(text, options=IngestOptions(day_first=day_first))
    assert np.diff(content.loops["A"].time_ns).tolist() == [days_apart * 1440 * MINUTE]
    assert content.summary.notes == ()


def test_times_that_are_numbers_already() -> None:
    seconds = pl.Series([1709251200.5, None, np.inf], dtype=pl.Float64)
    times_ns = TimeReader(TimeForm("epoch"), IngestOptions()).read(seconds)
    assert times_ns.tolist() == [START + 5 * 10**8, NO_TIME, NO_TIME]


def test_an_offset_among_local_times(read: Read) -> None:
    stamps = ("2024-03-01 00:00:00", "2024-03-01 00:01:00", "2024-03-01 00:02:00+01:00", "2024-02-29 23:03:00Z")
    rows = "".join(f"{stamp},{i},{10 * i}\n" for i, stamp in enumerate(stamps, start=1))
    content = read("Time,A.PV,A.OP\n" + rows, options=IngestOptions(time_zone="Europe/Berlin"))
    assert content.loops["A"].pv.tolist() == [1, 2, 3, 4]
    assert np.diff(content.loops["A"].time_ns).tolist() == [MINUTE] * 3
