"""Columns of times whose names tell their zone, and several of them beside each other."""

from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions, read_instants

from .conftest import Read
from .test_tables import parquet

UTC = [datetime(2026, 10, 24, 22) + timedelta(minutes=5 * i) for i in range(100)]  # over the hour that comes twice
AT = np.array(UTC, dtype="datetime64[ns]").astype(np.int64)
LOCAL = [time + timedelta(hours=2 if time < datetime(2026, 10, 25, 1) else 1) for time in UTC]
BERLIN = IngestOptions(time_zone="Europe/Berlin")
TOLD = "times are in the zone that the name of their column tells"


def table(names: str, row: str) -> str:
    pairs = enumerate(zip(UTC, LOCAL, strict=True))
    return f"{names}\n" + "".join(row.format(i=i, utc=utc, local=local) + "\n" for i, (utc, local) in pairs)


@pytest.mark.parametrize(
    ("names", "row"),
    [
        ("Local Time,UTC Time", "{local:%Y-%m-%d %H:%M:%S},{utc:%Y-%m-%d %H:%M:%S}"),
        ("UTC Time,Local Time", "{utc:%Y-%m-%d %H:%M:%S},{local:%d.%m.%Y %H:%M}"),
        ("Time (local),Time (UTC)", "{local:%d/%m/%Y %H:%M:%S},{utc:%d/%m/%Y %H:%M:%S}"),
        ("Timestamp,Timestamp_UTC", "{local:%Y-%m-%dT%H:%M:%S},{utc:%Y-%m-%dT%H:%M:%S}"),
        ("Ortszeit,UTC-Zeit", "{local:%d.%m.%Y %H:%M:%S},{utc:%d.%m.%Y %H:%M:%S}"),
        ("Local Date,Local Time,UTC Date,UTC Time", "{local:%d.%m.%Y},{local:%H:%M:%S},{utc:%d.%m.%Y},{utc:%H:%M:%S}"),
        ("Local Time,DateTimeGMT", "{local:%Y-%m-%d %H:%M:%S},{utc:%Y-%m-%d %H:%M:%S}"),
    ],
)
def test_utc_goes_before_local_times(read: Read, names: str, row: str) -> None:
    content = read(table(f"{names},A.PV,A.OP", row + ",{i},1{i}"), options=BERLIN)
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT)
    assert list(content.loops) == ["A"]
    assert not content.loops["A"].others
    assert content.rejects.total == 0
    assert content.summary.time_zone == "in the file"
    further, told = sorted(content.summary.notes)
    assert further.startswith("columns of further times were not read")
    assert TOLD in told


@pytest.mark.parametrize(
    ("name", "hours"), [("Time (UTC)", 0), ("UTC", 0), ("Time [UTC+1]", 1), ("Timestamp GMT-03:30", -3.5)]
)
def test_the_name_of_the_one_column_tells(read: Read, name: str, hours: float) -> None:
    content = read(table(f"{name},A.PV,A.OP", "{utc:%Y-%m-%d %H:%M:%S},{i},1{i}"), options=BERLIN)
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT - int(hours * 3600) * 10**9)
    assert TOLD in content.summary.notes[0]


def test_an_offset_in_the_rows_goes_before_the_name(read: Read) -> None:
    content = read(table("UTC Time,A.PV,A.OP", "{utc:%Y-%m-%d %H:%M:%S}+01:00,{i},1{i}"), options=BERLIN)
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT - 3600 * 10**9)
    assert content.summary.notes == ()


def test_rows_with_an_offset_among_those_of_the_name(read: Read) -> None:
    text = table("Time (UTC+1),A.PV,A.OP", "{utc:%Y-%m-%d %H:%M:%S},{i},1{i}") + "2026-10-25 08:00:00Z,7,7\n"
    assert read(text, options=BERLIN).loops["A"].time_ns[-1] == np.datetime64("2026-10-25T08:00", "ns").astype(int)


def test_long_tables(read: Read) -> None:
    times = "{local:%Y-%m-%d %H:%M:%S},{utc:%Y-%m-%d %H:%M:%S}"
    row = f"A.PV,{times},{{i}}\nA.OP,{times},1{{i}}"
    content = read(table("Tag,Local Time,UTC Time,Value", row), options=BERLIN)
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT)


def test_pairs_of_columns(read: Read) -> None:
    row = "{utc:%Y-%m-%d %H:%M:%S},{i},{utc:%Y-%m-%d %H:%M:%S},1{i}"
    content = read(table("Time (UTC),A.PV,Time (UTC),A.OP", row), options=BERLIN)
    assert content.summary.layout == "pi_datalink"
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT)


def test_times_of_a_table_with_types(read: Read) -> None:
    frame = pl.DataFrame({"UTC Time": UTC, "A.PV": range(100), "A.OP": range(100)})
    np.testing.assert_array_equal(read(parquet(frame), "a.parquet", options=BERLIN).loops["A"].time_ns, AT)


def test_times_of_a_simulation() -> None:
    found = read_instants(pl.Series("time_utc", [str(time) for time in UTC]), BERLIN)
    np.testing.assert_array_equal(found, AT)


def test_a_column_of_stamps_is_no_signal(read: Read) -> None:
    content = read(table("Time,Received,A.PV,A.OP", "{utc:%Y-%m-%d %H:%M},{local:%Y-%m-%d %H:%M},{i},1{i}"))
    assert content.summary.tags == 2
    assert "neither as times nor as values: Received" in content.summary.notes[0]


@pytest.mark.parametrize("name", ["Time (Europe/Berlin)", "Timestamp [Europe/Vienna]"])
def test_the_name_of_the_one_column_tells_a_zone_with_summer_time(read: Read, name: str) -> None:
    content = read(table(f"{name},A.PV,A.OP", "{local:%Y-%m-%d %H:%M:%S},{i},1{i}"))
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT)
    assert TOLD in content.summary.notes[0]


@pytest.mark.parametrize("name", ["Time (Europe/Nowhere)", "Time (North/South)"])
def test_a_name_that_is_of_no_zone(read: Read, name: str) -> None:
    content = read(table(f"{name},A.PV,A.OP", "{utc:%Y-%m-%d %H:%M:%S},{i},1{i}"))
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT)


@pytest.mark.parametrize("letters", ["CET", "EET", "CEST", "EST"])
def test_letters_that_leave_summer_time_open(read: Read, letters: str) -> None:
    content = read(table(f"Time ({letters}),A.PV,A.OP", "{local:%Y-%m-%d %H:%M:%S},{i},1{i}"), options=BERLIN)
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT)
    assert content.summary.time_zone == "Europe/Berlin"
    assert content.summary.notes[0].startswith(f"times are in the set zone: {letters} in the name")


BESIDE = "check this first, the file names a zone that was not taken: "


@pytest.mark.parametrize(
    ("above", "names", "zone", "told"),
    [
        ("# Time zone: UTC+01:00\n", "Time,FIC1.PV,FIC1.OP", "", "Time zone: UTC+01:00"),
        ("Zeitzone = Europe/Vienna\n", "Time,FIC1.PV,FIC1.OP", "", "Zeitzone = Europe/Vienna"),
        ("Time zone,CET\nServer,HIS1\n", "Time,FIC1.PV,FIC1.OP", "", "Time zone: CET"),
        ("", "Time,FIC1.PV,FIC1.OP,TZ", ",+03:00", "TZ is +03:00"),
        ("", "Time,FIC1.PV,FIC1.OP,Zone", ",EST", "Zone is EST"),
    ],
)
def test_a_zone_beside_the_times_is_told(read: Read, above: str, names: str, zone: str, told: str) -> None:
    rows = "".join(f"2026-05-14 06:{i:02d}:00,{50 + i % 7}.5,{40 + i % 5}.5{zone}\n" for i in range(60))
    content = read(f"{above}{names}\n{rows}", options=BERLIN)
    assert content.summary.notes[0].startswith(f"{BESIDE}{told}; times are in the set zone, Europe/Berlin")


@pytest.mark.parametrize(
    ("above", "names", "zone", "told"),
    [
        ("# Time zone: UTC+02:00\n", "Time,FIC1.PV,FIC1.OP", "", "Time zone: UTC+02:00"),
        ("Time zone,CEST\nServer,HIS1\n", "Time,FIC1.PV,FIC1.OP", "", "Time zone: CEST"),
        ("", "Time,FIC1.PV,FIC1.OP,TZ", ",+02:00", "TZ is +02:00"),
    ],
)
@pytest.mark.parametrize(("day", "same"), [("2026-05-14", True), ("2026-01-14", False)])
def test_an_offset_that_the_set_zone_has_in_that_season_contradicts_nothing(
    read: Read, above: str, names: str, zone: str, told: str, day: str, same: bool
) -> None:
    rows = "".join(f"{day} 06:{i:02d}:00,{50 + i % 7}.5,{40 + i % 5}.5{zone}\n" for i in range(60))
    note = read(f"{above}{names}\n{rows}", options=BERLIN).summary.notes[0]
    agrees = f"the file names a zone, {told}; Europe/Berlin, the set one, has the same clock at its first times"
    assert (note == agrees) == same
    assert note.startswith(BESIDE) != same


@pytest.mark.parametrize("told", ["UTC+02:00", "GMT-6", "Etc/GMT+1"])
def test_another_zone_than_utc_is_told_where_that_is_set(read: Read, told: str) -> None:
    rows = "".join(f"2026-05-14 06:{i:02d}:00,{50 + i % 7}.5,{40 + i % 5}.5\n" for i in range(60))
    notes = read(f"Time zone: {told}\nTime,FIC1.PV,FIC1.OP\n{rows}").summary.notes
    assert notes[0].startswith(f"{BESIDE}Time zone: {told}; times are in the set zone, UTC")


@pytest.mark.parametrize(
    ("above", "zone", "set_zone"),
    [
        ("Time zone: Europe/Berlin\n", "", "Europe/Berlin"),
        ("Time zone: UTC\n", "", "UTC"),
        ("Time zone\n", "", "UTC"),
        ("", ",+00:00", "UTC"),
        ("", ",Auto", "UTC"),
        ("", ",12.5", "UTC"),
        *(("", f",{word}", "UTC") for word in ("WET", "IST", "CST", "Plant/Unit1", "Auto/Cas", "+00:15")),
        *(
            (f"Time zone: {zone}\n", "", "UTC")
            for zone in ("Etc/UTC", "utc", "Coordinated Universal Time", "(UTC) Coordinated Universal Time", "UTC±0")
        ),
    ],
)
def test_no_zone_beside_the_times_or_the_set_one(read: Read, above: str, zone: str, set_zone: str) -> None:
    rows = "".join(f"2026-05-14 06:{i:02d}:00,{50 + i % 7}.5,{40 + i % 5}.5{zone}\n" for i in range(60))
    content = read(f"{above}Time,FIC1.PV,FIC1.OP{',X' * bool(zone)}\n{rows}", options=IngestOptions(time_zone=set_zone))
    assert not [note for note in content.summary.notes if note.startswith(BESIDE)]


@pytest.mark.parametrize("tag", ["Plant/FIC101", "Europe/FIC101"])
def test_a_tag_and_an_area_are_no_zones(read: Read, tag: str) -> None:
    rows = "".join(f"{tag},2026-05-14 06:{i:02d}:00,{50 + i % 7}.5,North/Unit1\n" for i in range(60))
    notes = read(f"Tag,Time,Value,Area\n{rows}").summary.notes
    assert not [note for note in notes if note.startswith(BESIDE)]


def test_zones_of_summer_and_winter_are_told_in_utc_too(read: Read) -> None:
    rows = "".join(
        f"2026-05-14 06:{i:02d}:00,{50 + i % 7}.5,{40 + i % 5}.5,{'CET' if i < 30 else 'CEST'}\n" for i in range(60)
    )
    assert read(f"Time,FIC1.PV,FIC1.OP,TZ\n{rows}").summary.notes[0].startswith(f"{BESIDE}TZ is CET; ")


def test_controls_in_the_name_of_a_zone_are_not_shown(read: Read) -> None:
    rows = "".join(f"2026-05-14 06:{i:02d}:00,{50 + i % 7}.5,{40 + i % 5}.5\n" for i in range(60))
    note = read(f"Time zone: \x1b[31mCET\x07\nTime,FIC1.PV,FIC1.OP\n{rows}").summary.notes[0]
    assert note.startswith(f"{BESIDE}Time zone: \ufffd[31mCET\ufffd; ")


def test_times_that_tell_their_zone_need_no_other(read: Read) -> None:
    rows = "".join(f"2026-05-14T06:{i:02d}:00Z,{50 + i % 7}.5,{40 + i % 5}.5\n" for i in range(60))
    content = read(f"Time zone: CET\nTime,FIC1.PV,FIC1.OP\n{rows}", options=BERLIN)
    assert not [note for note in content.summary.notes if note.startswith(BESIDE)]
