"""Dates that can be read in two orders: which one is taken, and what is said of it."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from app.ingest import IngestOptions, read_recordings

from .conftest import Read

NOW = int(np.datetime64("2026-11-23T04:00:00", "ns").astype(np.int64))
CLOCK = IngestOptions(now_ns=NOW)


def night(*stamps: str) -> str:
    rows = (f"{stamp} 0{hour}:{minute:02d}:00,1,2\n" for stamp in stamps for hour in range(6) for minute in range(60))
    return "Time,A.PV,A.OP\n" + "".join(rows)


def first_day(read: Read, text: str, options: IngestOptions) -> tuple[str, tuple[str, ...]]:
    content = read(text, options=options)
    return str(content.loops["A"].time_ns[:1].astype("datetime64[ns]")[0])[:10], content.summary.notes


@pytest.mark.parametrize(
    ("stamp", "day", "said"),
    [
        ("11/12/2026", "2026-11-12", "month first (03/04/2026 is 4 March)|`--date-order day` reads them the other way"),
        ("12/11/2026", "2026-11-12", "day first (03/04/2026 is 3 April)|`--date-order month` reads them the other way"),
    ],
)
def test_samples_are_not_ahead_of_the_clock(read: Read, stamp: str, day: str, said: str) -> None:
    found, notes = first_day(read, night(stamp), CLOCK)
    assert found == day
    (note,) = notes
    read_as, otherwise = said.split("|")
    assert note == f"dates were read {read_as}, because read otherwise, times lie ahead of the clock; {otherwise}"


def test_years_of_two_digits_may_be_first_too(read: Read) -> None:
    found, (note,) = first_day(read, night("11-12-26"), CLOCK)
    assert found == "2026-11-12"
    assert note.startswith("dates were read month first")
    assert note.endswith("`--date-order day` reads them the other way")
    note = first_day(read, night("26-11-12"), IngestOptions(now_ns=NOW))[1][0]
    assert note.endswith(
        "; check this first, the year may stand first too: the first one was read as 2012-11-26, and is 2026-11-12 then"
    )


def test_without_a_clock_the_usual_order_is_taken(read: Read) -> None:
    found, (note,) = first_day(read, night("11/12/2026"), IngestOptions())
    assert found == "2026-12-11"
    assert "because nothing in the file tells" in note


def test_orders_that_are_both_in_the_past_stay_open(read: Read) -> None:
    found, (note,) = first_day(read, night("04/03/2026"), CLOCK)
    assert found == "2026-03-04"
    assert "because nothing in the file tells" in note


@pytest.mark.parametrize("stamp", ["11/12/2027", "2027-12-11"])
def test_times_ahead_of_the_clock_in_every_order_are_kept_and_told(read: Read, stamp: str) -> None:
    found, notes = first_day(read, night(stamp), CLOCK)
    assert found == "2027-12-11"
    assert "times go on until 2027-12-11 05:59 UTC, ahead of the clock (2026-11-23 04:00 UTC)" in notes[-1]


def test_hours_ahead_of_the_clock_are_another_zone_and_told(read: Read) -> None:
    found, (note,) = first_day(read, night("2026-11-23"), CLOCK)
    assert found == "2026-11-23"
    assert "ahead of the clock (2026-11-23 04:00 UTC) by 2 hours" in note


def test_minutes_ahead_of_the_clock_are_no_other_zone(read: Read) -> None:
    just_before = IngestOptions(now_ns=NOW + 110 * 60 * 1_000_000_000)
    assert first_day(read, night("2026-11-23"), just_before) == ("2026-11-23", ())


@pytest.mark.parametrize(("day_first", "day"), [(True, "2026-12-11"), (False, "2026-11-12")])
def test_what_is_said_goes_before_the_clock(read: Read, day_first: bool, day: str) -> None:
    found, notes = first_day(read, night("11/12/2026"), IngestOptions(day_first=day_first, now_ns=NOW))
    assert found == day
    assert not any("dates were read" in note for note in notes)


def test_a_date_that_cannot_be_what_is_said_is_read_and_told(read: Read) -> None:
    found, (note,) = first_day(read, night("11/20/2026"), IngestOptions(day_first=True, now_ns=NOW))
    assert found == "2026-11-20"
    assert note == "the day was said to stand first, but more dates can be read as %m/%d/%Y %H:%M:%S"


def test_years_of_two_digits_are_not_first_where_it_is_said(read: Read) -> None:
    options = IngestOptions(day_first=True)
    assert first_day(read, night("05/03/12", "06/03/12"), options)[0] == "2012-03-05"


def test_recordings_tell_the_order_too(tmp_path: Path) -> None:
    path = tmp_path / "us.csv"
    path.write_text(night("11/12/2026"))
    assert "ahead of the clock" in read_recordings(path, options=CLOCK).notes[0]


@pytest.mark.parametrize("packed", [False, True])
def test_the_last_day_tells_the_order_of_a_packed_file_too(read: Read, packed: bool) -> None:
    days = (f"05/{day:02d}/2026 {at // 60:02d}:{at % 60:02d}:00" for day in range(1, 17) for at in range(1440))
    data = (
        "Time,A.PV,A.OP\n" + "".join(f"{stamp},{50 + k % 7},{40 + k % 5}\n" for k, stamp in enumerate(days))
    ).encode()
    content = read(gzip.compress(data) if packed else data, options=CLOCK)
    days_read = content.loops["A"].time_ns[[0, -1]].astype("datetime64[ns]").astype("datetime64[D]").astype(str)
    assert days_read.tolist() == ["2026-05-01", "2026-05-16"]


def test_both_orders_in_one_file_are_told(read: Read) -> None:
    text = night(*(f"{day:02d}/03/2024" for day in range(9, 14)), *(f"03/{day:02d}/2024" for day in range(14, 20)))
    content = read(text)
    refused = content.rejects.counts["bad_time"]
    (note,) = (note for note in content.summary.notes if "both orders" in note)
    assert f": {refused:,} dates fit with them exchanged alone" in note
    assert not any("both orders" in note for note in read(night("13/03/2024", "14/03/2024", "soon")).summary.notes)


@pytest.mark.parametrize("last", [1, 5])
def test_few_dates_that_tell_the_order_do_so_where_time_runs_on(read: Read, last: int) -> None:
    """Against what was said too; a damaged date among others, from which time runs back, tells nothing."""
    stamps = [f"12/03/2024 23:{i // 60:02}:{i % 60:02}" for i in range(390 - last)]
    stamps += [f"13/03/2024 00:00:{i:02}" for i in range(last)]
    rows = [f"{stamp},{i},1" for i, stamp in enumerate(stamps)]
    for day_first in (None, False):
        content = read("\n".join(["Time,A.PV,A.OP", *rows, ""]), options=IngestOptions(day_first=day_first))
        assert content.summary.time_format.startswith("%d/%m")
    rows = [*rows[: -last - 9], *rows[-last:], *rows[-last - 9 : -last]]
    content = read("\n".join(["Time,A.PV,A.OP", *rows, ""]), options=IngestOptions(day_first=False))
    assert content.summary.time_format.startswith("%m/%d") == (last == 1)
