"""Date and clock in two columns, whatever the columns are called."""

import io
from collections.abc import Callable, Collection
from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from app.ingest import IngestOptions
from app.ingest.columns.joined_stamps import stamps_of, stamps_of_rows

from .conftest import Read
from .test_tables import workbook

START = np.datetime64("2026-03-01T22:00:00", "ns").astype(np.int64)
STEPS = np.arange(300) * 30
STAMPS = [np.datetime64("2026-03-01T22:00:00") + np.timedelta64(int(s), "s") for s in STEPS]


def table(head: str, date: str, columns: str = "{date};{clock};{i},5;{i},25") -> str:
    days = [stamp.item() for stamp in STAMPS]
    rows = (columns.format(date=f"{day:{date}}", clock=f"{day:%H:%M:%S}", i=i) for i, day in enumerate(days))
    return "\n".join((head, *rows)) + "\n"


def check(read: Read, text: str) -> None:
    content = read(text)
    loop = content.loops["FIC1"]
    np.testing.assert_array_equal(loop.time_ns - START, STEPS * 10**9)
    np.testing.assert_array_equal(loop.pv, np.arange(300) + 0.5)
    np.testing.assert_array_equal(loop.op, np.arange(300) + 0.25)
    assert content.rejects.total == 0


@pytest.mark.parametrize(
    ("names", "date"),
    [
        ("Datum;Uhrzeit", "%d.%m.%Y"),
        ("Datum;Zeit", "%d.%m.%Y"),
        ("Date;Heure", "%d/%m/%Y"),
        ("Fecha;Hora", "%d-%m-%Y"),
        ("Day;Clock", "%Y-%m-%d"),
        ("Date;Time", "%Y%m%d"),
    ],
)
def test_by_what_the_columns_hold(read: Read, names: str, date: str) -> None:
    check(read, table(f"{names};FIC1.PV;FIC1.OP", date))


def test_the_clock_may_stand_first_or_apart(read: Read) -> None:
    check(read, table("Zeit;Datum;FIC1.PV;FIC1.OP", "%d.%m.%Y", "{clock};{date};{i},5;{i},25"))
    check(read, table("Datum;FIC1.PV;FIC1.OP;Uhrzeit", "%d.%m.%Y", "{date};{i},5;{i},25;{clock}"))


def test_below_a_row_of_units(read: Read) -> None:
    check(read, table("Datum;Uhrzeit;FIC1.PV;FIC1.OP\n;;m3/h;%", "%d.%m.%Y"))


def test_in_a_long_table(read: Read) -> None:
    columns = "FIC1.PV;{date};{clock};{i},5\nFIC1.OP;{date};{clock};{i},25"
    check(read, table("Tagname;Datum;Uhrzeit;Value", "%d.%m.%Y", columns))


def test_dates_alone_stay_dates(read: Read) -> None:
    rows = "".join(f"2026-03-{day:02d},1{day},{day}\n" for day in range(1, 9))
    loop = read("Datum,FIC1.PV,FIC1.OP\n" + rows).loops["FIC1"]
    np.testing.assert_array_equal(np.diff(loop.time_ns), 86400 * 10**9)


def test_spreadsheets_write_dates_at_midnight_and_clocks_on_their_first_day() -> None:
    dates = ["2026-03-01 00:00:00", "2026-03-01", "2026-03-02 00:00:00.000"]
    clocks = ["1899-12-31 22:00:00", "22:00:10", "1899-12-30 00:00:00"]
    expected = ["2026-03-01 22:00:00", "2026-03-01 22:00:10", "2026-03-02 00:00:00"]
    assert stamps_of_rows(zip(dates, clocks, strict=True), (0, 1)) == expected
    frame = pl.DataFrame({"c0": dates, "c1": clocks})
    assert stamps_of(frame, (0, 1)).to_list() == expected
    assert stamps_of(frame, (0,)).to_list() == dates


@pytest.mark.parametrize(
    ("date", "clock"),
    [
        ("{:%-m/%-d/%Y} 0:00:00", "{:%H:%M:%S}"),
        ("{:%-m/%-d/%Y} 12:00:00 AM", "{:%I:%M:%S %p}"),
        ("{:%m/%d/%Y} 12:00 AM", "{:%I:%M:%S %p}"),
        ("{:%d.%m.%Y} 00:00", "{:%H:%M:%S}"),
        ("{:%d.%m.%Y} 0:00", "{:%H:%M:%S}"),
    ],
)
@pytest.mark.parametrize("names", ["Date,Time", "Time,Date", "Day,Clock"])
def test_dates_at_midnight_as_regional_settings_write_them(read: Read, names: str, date: str, clock: str) -> None:
    days = [stamp.item() + timedelta(days=23) for stamp in STAMPS]
    parts = {"date": date, "clock": clock}
    first, second = ("clock", "date") if names == "Time,Date" else ("date", "clock")
    rows = (f"{parts[first].format(day)},{parts[second].format(day)},{i},1{i}\n" for i, day in enumerate(days))
    loop = read(f"{names},FIC1.PV,FIC1.OP\n" + "".join(rows)).loops["FIC1"]
    np.testing.assert_array_equal(loop.time_ns - START - 23 * 86400 * 10**9, STEPS * 10**9)


def counted(names: str, stamp: Callable[[int], str], units: str = "") -> str:
    return f"{names},FIC1.PV,FIC1.OP\n{units}" + "".join(f"{i},{stamp(i)},{i},1{i}\n" for i in range(600))


@pytest.mark.parametrize("units", ["", "s,-,m3/h,%\n"])
@pytest.mark.parametrize("names", ["Time,Timestamp", "Time (s),DateTime"])
@pytest.mark.parametrize(
    "stamp",
    [
        lambda i: "2026-03-04 09:00:00",
        lambda i: f"{STAMPS[0].item() + timedelta(seconds=i)}" if i < 300 else "",
        lambda i: f"{STAMPS[0].item() + timedelta(seconds=i)}" if i >= 300 else "",
        lambda i: f"3/{1 + i // 300}/2026 0:00:00",
    ],
    ids=["of the start", "half filled", "filled late", "dates"],
)
def test_stamps_that_tell_no_instants_do_not_go_before_counts(
    read: Read, names: str, stamp: Callable[[int], str], units: str
) -> None:
    content = read(counted(names, stamp, units))
    assert np.unique(np.diff(content.loops["FIC1"].time_ns)).tolist() == [10**9]
    assert content.loops["FIC1"].samples == 600


def test_stamps_that_move_go_before_counts(read: Read) -> None:
    text = counted("Time,Timestamp", lambda i: f"{STAMPS[0].item() + timedelta(seconds=7 * i)}", "s,-,m3/h,%\n")
    loop = read(text).loops["FIC1"]
    np.testing.assert_array_equal(loop.time_ns - START, np.arange(600) * 7 * 10**9)


def test_a_workbook_with_date_and_clock_apart(read: Read) -> None:
    pytest.importorskip("fastexcel", reason="the extra 'excel' is not installed")
    days = [stamp.item() for stamp in STAMPS]
    cells = [
        [f"{day:%Y-%m-%d} 00:00:00", f"1899-12-31 {day:%H:%M:%S}", f"{i}.5", f"{i}.25"] for i, day in enumerate(days)
    ]
    loop = read(workbook([["Datum", "Uhrzeit", "FIC1.PV", "FIC1.OP"], *cells]), name="night.xlsx").loops["FIC1"]
    np.testing.assert_array_equal(loop.time_ns - START, STEPS * 10**9)


def test_a_parquet_file_with_dates_and_clocks(read: Read) -> None:
    days = [stamp.item() for stamp in STAMPS]
    columns = {"Day": [day.date() for day in days], "Clock": [day.time() for day in days]}
    frame = pl.DataFrame({**columns, "FIC1.PV": STEPS * 1.5, "FIC1.OP": STEPS * 0.5})
    target = io.BytesIO()
    frame.write_parquet(target)
    loop = read(target.getvalue(), name="night.parquet").loops["FIC1"]
    np.testing.assert_array_equal(loop.time_ns - START, STEPS * 10**9)


def dated_once(count: int, without: Collection[int] = ()) -> list[str]:
    """Rows of five minutes from 22:00 on, each day's first one with its date."""
    times = [datetime(2024, 3, 12, 22) + timedelta(minutes=5 * i) for i in range(count)]
    first = {i for i, at in enumerate(times) if (i == 0 or at.hour + at.minute == 0) and i not in without}
    return [f"{at:%d.%m.%Y};{at:%H:%M}" if i in first else f";{at:%H:%M}" for i, at in enumerate(times)]


@pytest.mark.parametrize("newest_first", [False, True])
@pytest.mark.parametrize("chunk_bytes", [100, 1 << 20])
def test_a_date_in_the_first_row_of_a_day_is_that_of_the_rows_below(
    read: Read, newest_first: bool, chunk_bytes: int
) -> None:
    stamps = dated_once(84)
    if newest_first:
        stamps = [stamp[-6:] for stamp in stamps[::-1]]
        stamps[0], stamps[60] = f"13.03.2024{stamps[0]}", f"12.03.2024{stamps[60]}"
    rows = [f"{stamp};{i};1" for i, stamp in enumerate(stamps)]
    content = read("\n".join(["Datum;Uhrzeit;A.PV;A.OP", *rows, ""]), options=IngestOptions(chunk_bytes=chunk_bytes))
    assert np.all(np.diff(content.loops["A"].time_ns) == 300 * 10**9)
    assert content.loops["A"].samples == 84
    assert content.rejects.total == 0
    assert any("clock without a date" in note for note in content.summary.notes)


@pytest.mark.parametrize("chunk_bytes", [100, 1 << 20])
def test_a_clock_that_runs_back_has_no_date_of_the_row_above(read: Read, chunk_bytes: int) -> None:
    rows = [f"A.PV;{stamp};{i}\nA.OP;{stamp};1" for i, stamp in enumerate(dated_once(340, without=(24,)))]
    content = read("\n".join(["Tag;Date;Time;Value", *rows, ""]), options=IngestOptions(chunk_bytes=chunk_bytes))
    kept = [*range(24), *range(24 + 288, 340)]
    assert content.loops["A"].pv.tolist() == kept
    assert dict(content.rejects.counts) == {"bad_time": 2 * 288}


def test_a_row_without_its_date_at_midnight_is_refused(read: Read) -> None:
    rows = [f"2024-03-{12 + (i + 264) // 288};{(22 + i // 12) % 24:02}:{i % 12 * 5:02};{i};1" for i in range(60)]
    rows[24] = rows[24][10:]
    content = read("\n".join(["Date;Time;A.PV;A.OP", *rows, ""]))
    assert content.loops["A"].samples == 59
    assert dict(content.rejects.counts) == {"bad_time": 1}
