"""Clocks of twelve hours and clocks in digits beside dates, days of the year, and stamps in digits: read where their
text tells what they are, else refused."""

from collections.abc import Callable
from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from app.errors import DataError
from app.ingest.model import IngestOptions
from app.ingest.times.digit_clocks import HHMM, HHMMSS, IN_DOUBT, UNKNOWN, digits_of, with_clock
from tests.ingest.conftest import Read

START = datetime(2024, 3, 5)
Stamp = Callable[[datetime], str]


def table(names: str, stamp: Stamp, step_s: int, rows: int = 200, start: datetime = START, back: bool = False) -> str:
    times = [start + timedelta(seconds=k * step_s) for k in range(rows)]
    lines = [f"{stamp(at)},{50 + k % 9}.25,{40 + k % 7}.5" for k, at in enumerate(times)]
    return "\n".join((f"{names},FIC1.PV,FIC1.OP", *(lines[::-1] if back else lines))) + "\n"


def times(step_s: int, rows: int = 200, start: datetime = START) -> list[int]:
    first = int(np.datetime64(start, "ns").astype(np.int64))
    return [first + k * step_s * 10**9 for k in range(rows)]


def of_twelve(at: datetime) -> int:
    return (at.hour - 1) % 12 + 1


def number(at: datetime, form: str) -> str:
    return str(int(at.strftime(form)))


@pytest.mark.parametrize(
    ("names", "stamp", "step_s"),
    [
        ("Date,Hour,AM/PM", lambda at: f"{at:%Y-%m-%d},{of_twelve(at)},{at:%p}", 3600),
        ("Date,AMPM,Hour", lambda at: f"{at:%Y-%m-%d},{at:%p},{of_twelve(at)}", 3600),
        ("Date,Hour,Minute,M", lambda at: f"{at:%Y-%m-%d},{of_twelve(at)},{at.minute},{at:%p}", 600),
        ("Date,Time,AM/PM", lambda at: f"{at:%m/%d/%Y},{at:%I:%M:%S},{at:%p}".lower(), 600),
        ("Date,Time,AM/PM", lambda at: f"{at:%Y-%m-%d},{at:%I:%M},{'a.m.' if at.hour < 12 else 'p.m.'}", 600),
        ("Time,AM/PM", lambda at: f"{at:%m/%d/%Y %I:%M:%S},{at:%p}", 600),
        ("Year,Month,Day,Hour,Minute,AM/PM", lambda at: f"{at:%Y,%m,%d},{of_twelve(at)},{at.minute},{at:%p}", 600),
    ],
)
def test_am_and_pm_in_a_column_of_their_own(read: Read, names: str, stamp: Stamp, step_s: int) -> None:
    content = read(table(names, stamp, step_s))
    assert list(content.loops) == ["FIC1"]
    assert content.loops["FIC1"].time_ns.tolist() == times(step_s)
    assert not content.rejects.counts


def test_a_row_without_am_or_pm_is_refused(read: Read) -> None:
    lines = table("Date,Hour,Minute,AM/PM", lambda at: f"{at:%Y-%m-%d},{of_twelve(at)},{at:%M,%p}", 600).splitlines()
    lines[30], lines[60] = (lines[at].replace("AM", "").replace("PM", "") for at in (30, 60))
    content = read("\n".join(lines) + "\n")
    assert dict(content.rejects.counts) == {"bad_time": 2}
    assert content.loops["FIC1"].samples == 198


def test_am_and_pm_beside_a_clock_of_24_hours_are_not_joined(read: Read) -> None:
    content = read(table("Date,Time,AM/PM", lambda at: f"{at:%Y-%m-%d},{at:%H:%M:%S},{at:%p}", 3600))
    assert content.loops["FIC1"].time_ns.tolist() == times(3600)


@pytest.mark.parametrize("start", [START.replace(hour=hour) for hour in (0, 1, 8, 12, 13)])
@pytest.mark.parametrize(
    ("names", "stamp"),
    [
        ("Date,Time,AM/PM", lambda at: f"{at:%Y-%m-%d},{at:%H:%M:%S},{at:%p}"),
        ("Time,AM/PM", lambda at: f"{at:%Y-%m-%d %H:%M:%S},{at:%p}"),
        ("Date,Hour,Minute,Second,Half", lambda at: f"{at:%Y-%m-%d},{at.hour},{at.minute},{at.second},{at:%p}"),
    ],
)
def test_am_and_pm_beside_24_hours_of_which_the_first_rows_show_one_half(
    read: Read, names: str, stamp: Stamp, start: datetime
) -> None:
    content = read(table(names, stamp, 10, 9000, start))
    assert content.loops["FIC1"].time_ns.tolist() == times(10, 9000, start)
    assert not content.rejects.counts


@pytest.mark.parametrize(("name", "hour"), [("Shift", 1), ("Shift", 5), ("Watch", 0), ("Watch", 5)])
def test_shifts_that_are_called_so_are_no_halves_of_the_day(read: Read, name: str, hour: int) -> None:
    start, shift = START.replace(hour=hour, minute=30), ("PM", "AM")
    content = read(table(f"Time,{name}", lambda at: f"{at},{shift[6 <= at.hour < 18]}", 60, 1200, start))
    assert content.loops["FIC1"].time_ns.tolist() == times(60, 1200, start)


@pytest.mark.parametrize("options", [IngestOptions(), IngestOptions(chunk_bytes=1000, buffered_values=100)])
@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize(
    ("names", "stamp"),
    [
        ("Date,Hour", lambda at: f"{at:%Y-%m-%d},{of_twelve(at)}"),
        ("Year,Month,Day,Hour,Minute", lambda at: f"{at:%Y,%m,%d},{of_twelve(at)},{at.minute}"),
    ],
)
def test_hours_to_12_that_come_twice_a_day_are_refused(
    read: Read, names: str, stamp: Stamp, back: bool, options: IngestOptions
) -> None:
    with pytest.raises(DataError, match="nothing tells AM from PM; needed are hours from 0 to 23") as error:
        read(table(names, stamp, 3600, rows=1000, back=back), options=options)
    assert error.value.code == "unknown_layout"


def test_hours_to_12_of_the_mornings_alone_are_read(read: Read) -> None:
    lines = table("Date,Hour", lambda at: f"{at:%Y-%m-%d},{at.hour}", 3600).splitlines()
    content = read("\n".join([lines[0], *(line for line in lines[1:] if 1 <= int(line.split(",")[1]) <= 12)]) + "\n")
    assert content.loops["FIC1"].samples == 103


@pytest.mark.parametrize(
    ("names", "stamp", "step_s"),
    [
        ("Date,Time", lambda at: f"{at:%Y-%m-%d},{number(at, '%H%M')}", 600),
        ("Date,Time", lambda at: f"{at:%Y-%m-%d},{at:%H%M}", 600),
        ("Date,Hour", lambda at: f"{at:%d.%m.%Y},{number(at, '%H%M')}.0", 600),
        ("Date,Hour", lambda at: f"{at:%Y%m%d},{at:%H%M}", 600),
        ("Date,HHMM", lambda at: f"{at:%Y-%m-%d} 00:00:00,{number(at, '%H%M')}", 300),
        ("Date,Time", lambda at: f"{at:%Y-%m-%d},{number(at, '%H%M%S')}", 60),
        ("Date,Clock", lambda at: f"{at:%Y-%m-%d},{at:%H%M%S}", 60),
        ("Year,DOY,Hour,Minute", lambda at: f"{at:%Y},{number(at, '%j')},{at.hour},{at.minute}", 600),
        ("Year,Day of year,Time", lambda at: f"{at:%Y},{at:%j},{at:%H:%M:%S}", 60),
        ("DOY,Year,HHMM", lambda at: f"{number(at, '%j')},{at:%Y},{number(at, '%H%M')}", 600),
        ("Year,Day,Hour", lambda at: f"{at:%Y},{number(at, '%j')},{at.hour}", 3600),
        ("Date,Hour", lambda at: f"{at:%Y%m%d},{at.hour}", 3600),
    ],
)
@pytest.mark.parametrize("start", [START, datetime(2024, 3, 5, 20)])
def test_clocks_in_digits_and_days_of_the_year(
    read: Read, names: str, stamp: Stamp, step_s: int, start: datetime
) -> None:
    content = read(table(names, stamp, step_s, 2000, start))
    assert list(content.loops) == ["FIC1"]
    assert not content.loops["FIC1"].others
    assert content.loops["FIC1"].time_ns.tolist() == times(step_s, 2000, start)
    assert not content.rejects.counts


def test_clocks_in_digits_in_a_table_of_a_tag_a_row(read: Read) -> None:
    at = [START + timedelta(minutes=10 * k) for k in range(300)]
    rows = [f"{s},{t:%Y-%m-%d},{number(t, '%H%M')},{k % 9}" for k, t in enumerate(at) for s in ("FIC1.PV", "FIC1.OP")]
    content = read("Tag,Date,Time,Value\n" + "\n".join(rows))
    assert content.loops["FIC1"].time_ns.tolist() == times(600, 300)


def test_clocks_that_may_be_hhmm_or_hhmmss_are_refused(read: Read) -> None:
    with pytest.raises(DataError, match="that may be HHMM or HHMMSS") as error:
        read(table("Date,Time", lambda at: f"{at:%Y-%m-%d},{number(at, '%H%M')}", 600, rows=100))
    assert error.value.code == "unknown_layout"
    named = read(table("Date,HHMM", lambda at: f"{at:%Y-%m-%d},{number(at, '%H%M')}", 600, rows=100))
    assert named.loops["FIC1"].time_ns.tolist() == times(600, 100)


def test_values_beside_a_date_that_are_called_time_are_no_clock(read: Read) -> None:
    times = [START + timedelta(minutes=10 * k) for k in range(400)]
    lines = [
        f"{at:%Y-%m-%d},{of_twelve(at)},{at:%p},{50 + k % 9}.25,{40 + k % 7}.5,{100 + k * 37 % 50}"
        for k, at in enumerate(times)
    ]
    with pytest.raises(DataError):
        read("\n".join(("Date,Hour,AM/PM,FIC1.PV,FIC1.OP,Time", *lines)) + "\n")


def test_running_hours_beside_a_date_are_no_clock(read: Read) -> None:
    with pytest.raises(DataError, match="dates without a clock"):
        read(table("Date,Hours", lambda at: f"{at:%Y-%m-%d},{100 * (at.day - 1)}", 3600))


@pytest.mark.parametrize(
    ("clocks", "digits"),
    [
        (["0", "59", "100", "2359"], IN_DOUBT),
        (["0", "100", "160"], UNKNOWN),
        (["0600", "1200"], HHMM),
        (["600", "61500"], HHMMSS),
        (["600", "610"] * 100 + ["10610"], IN_DOUBT),
        (["1", "12"], UNKNOWN),
        (["2400", "2401"], UNKNOWN),
    ],
)
def test_digits_of_clocks(clocks: list[str], digits: int) -> None:
    assert digits_of([f"2024-03-05 {clock}" for clock in clocks]) == digits


def test_clocks_with_more_digits_than_theirs_are_left() -> None:
    stamps = pl.Series(["2024-03-05 600", "2024-03-05 61500", "2024-03-05 0", None])
    assert with_clock(stamps, HHMM).to_list() == ["2024-03-05 06:00", "2024-03-05 61500", "2024-03-05 00:00", None]


@pytest.mark.parametrize(
    ("stamp", "step_s", "beyond_ns"),
    [
        (lambda at: f"{at:%Y%m%d%H%M%S}123", 10, 123_000_000),
        (lambda at: f"{at:%Y%m%d%H%M%S}", 10, 0),
        (lambda at: f"{at:%Y%m%d%H%M}", 60, 0),
        (lambda at: f"{at:%Y-%jT%H:%M:%S}Z", 10, 0),
    ],
)
def test_stamps_in_digits(read: Read, stamp: Stamp, step_s: int, beyond_ns: int) -> None:
    content = read(table("Time", stamp, step_s))
    assert content.loops["FIC1"].time_ns.tolist() == [at + beyond_ns for at in times(step_s)]


def test_stamps_to_the_hour_in_digits_are_no_seconds_since_1970(read: Read) -> None:
    with pytest.raises(DataError, match="no row has a time that can be read; the first of them is '2024030500'"):
        read(table("Time", "{:%Y%m%d%H}".format, 3600))


def test_dates_in_digits_are_no_seconds(read: Read) -> None:
    assert read(table("Date", "{:%Y%m%d}".format, 86400)).loops["FIC1"].time_ns.tolist() == times(86400)


def test_a_damaged_stamp_in_digits_does_not_make_counts_of_the_others(read: Read) -> None:
    lines = table("Time", "{:%Y%m%d%H%M}".format, 60).splitlines()
    lines[5] = lines[5].replace("202403", "202499", 1)
    content = read("\n".join(lines) + "\n")
    assert dict(content.rejects.counts) == {"bad_time": 1}
    assert content.loops["FIC1"].time_ns.tolist() == [at for k, at in enumerate(times(60)) if k != 4]


@pytest.mark.parametrize("name", ["Batch date", "Update"])
def test_a_number_that_is_no_date_of_the_rows_is_none_by_its_name(read: Read, name: str) -> None:
    content = read(table(f"{name},Time,Date", lambda at: f"20240301,{at:%H:%M:%S},{at:%Y-%m-%d}", 60))
    assert content.loops["FIC1"].time_ns.tolist() == times(60)
