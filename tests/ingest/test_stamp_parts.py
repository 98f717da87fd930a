"""Hours, or all parts of a stamp, in columns of their own are joined to times; what looks like them is left alone."""

from collections.abc import Callable
from datetime import datetime, timedelta

import numpy as np
import pytest

from app.errors import DataError
from app.ingest import LoopSamples, parse_named
from app.ingest.model import IngestOptions
from tests.ingest.conftest import Read

START = datetime(2024, 5, 1)
HOUR_S, ROWS = 3600, 60


def wide(names: str, stamp: Callable[[datetime], str], step_s: int, rows: int = ROWS, delimiter: str = ",") -> str:
    """A file whose rows have the stamp's parts before PV and OP of FIC1."""
    times = [START + timedelta(seconds=k * step_s) for k in range(rows)]
    lines = [f"{stamp(at)},{50 + k % 9}.25,{40 + k % 7}.5" for k, at in enumerate(times)]
    text = "\n".join((f"{names},FIC1.PV,FIC1.OP", *lines)) + "\n"
    return text.replace(",", delimiter)


def expected_ns(step_s: int, rows: int = ROWS, start: datetime = START) -> list[int]:
    first = int(np.datetime64(start, "ns").astype(np.int64))
    return [first + k * step_s * 10**9 for k in range(rows)]


def times_of(samples: LoopSamples) -> list[int]:
    assert samples.pv is not None
    assert samples.pv.tolist() == [50.25 + k % 9 for k in range(len(samples.pv))]
    return samples.time_ns.tolist()


@pytest.mark.parametrize(
    ("names", "form", "step_s"),
    [
        ("Date,Hour", "{0:%Y-%m-%d},{0.hour}", HOUR_S),
        ("Datum,Stunde", "{0:%d.%m.%Y},{0:%H}", HOUR_S),
        ("Date,Time", "{0:%Y-%m-%d},{0.hour}", HOUR_S),
        ("Date,Hour", "{0:%Y-%m-%d},{0.hour}.0", HOUR_S),
        ("Hour,Date", "{0.hour},{0:%Y-%m-%d}", HOUR_S),
        ("Date,Hour,Minute", "{0:%Y-%m-%d},{0.hour},{0.minute}", 60),
        ("Date,Hour,Minute", "{0:%Y-%m-%d} 00:00:00,{0.hour},{0.minute}", 60),
        ("Date,Hour,Min,Sec", "{0:%Y-%m-%d},{0.hour},{0.minute},{0.second}", 1),
        ("Year,Month,Day,Hour", "{0:%Y},{0.month},{0.day},{0.hour}", HOUR_S),
        ("Year,Month,Day,Hour,Minute", "{0:%Y},{0.month},{0.day},{0.hour},{0.minute}", 60),
        ("Year,Month,Day,Hour,Minute,Second", "{0:%Y,%m,%d,%H,%M,%S}", 1),
        ("Day,Month,Year,Hour,Minute,Seconds", "{0:%d,%m,%Y,%H,%M,%S}", 1),
        ("Year,Month,Day,Hour,Minute,Second", "{0:%Y}.0,{0.month}.0,{0.day}.0,{0.hour}.0,{0.minute}.0,{0.second}.0", 1),
        ("Second,Minute,Year,Day,Month,Hour", "{0.second},{0.minute},{0.year},{0.day},{0.month},{0.hour}", 1),
        ("Year,Month,Day,Time", "{0:%Y,%m,%d,%H:%M:%S}", 1),
        ("Jahr,Monat,Tag,Stunde,Minute,Sekunde", "{0:%Y},{0.month},{0.day},{0.hour},{0.minute},{0.second}", 1),
    ],
)
def test_parts_of_a_stamp_are_joined(read: Read, names: str, form: str, step_s: int) -> None:
    content = read(wide(names, form.format, step_s, delimiter=",;\t"[len(names) % 3]))
    assert list(content.loops) == ["FIC1"]
    assert not content.loops["FIC1"].others
    assert times_of(content.loops["FIC1"]) == expected_ns(step_s)
    assert not content.rejects.counts
    assert any(note.startswith("the times were joined from their parts") for note in content.summary.notes)


def test_seconds_with_decimals(read: Read) -> None:
    rows = [f"2024;5;1;0;0;{k / 4:.2f};{k % 7};{k % 5}".replace(".", ",") for k in range(ROWS)]
    content = read("Year;Month;Day;Hour;Minute;Second;FIC1.PV;FIC1.OP\n" + "\n".join(rows))
    assert np.unique(np.diff(content.loops["FIC1"].time_ns)).tolist() == [250_000_000]


def test_hours_from_1_to_24_end_at_midnight(read: Read) -> None:
    content = read(wide("Date,Hour", lambda at: f"{at:%Y-%m-%d},{at.hour + 1}", HOUR_S))
    assert times_of(content.loops["FIC1"]) == expected_ns(HOUR_S, start=START + timedelta(hours=1))


def test_in_a_table_of_a_tag_a_row(read: Read) -> None:
    rows = [f"{s},2024,5,1,{k // 60},{k % 60},{k % 9}.5" for s in ("FIC1.PV", "FIC1.OP") for k in range(120)]
    content = read("Tag,Year,Month,Day,Hour,Minute,Value\n" + "\n".join(rows))
    assert content.loops["FIC1"].time_ns.tolist() == expected_ns(60, 120)


def test_milliseconds_behind_them(read: Read) -> None:
    names = "Year,Month,Day,Hour,Minute,Second,Millisecond"
    rows = [f"2024,5,1,0,{k // 120},{k // 2 % 60},{500 * (k % 2)},{k % 9},{k % 7}" for k in range(240)]
    content = read(f"{names},FIC1.PV,FIC1.OP\n" + "\n".join(rows))
    assert np.unique(np.diff(content.loops["FIC1"].time_ns)).tolist() == [500_000_000]


def test_a_row_without_its_hour_is_refused(read: Read) -> None:
    lines = wide("Date,Hour,Minute", "{0:%Y-%m-%d},{0.hour},{0.minute}".format, 60).splitlines()
    lines[20] = "2024-05-01,,19,1,1"
    content = read("\n".join(lines) + "\n")
    assert dict(content.rejects.counts) == {"bad_time": 1}
    assert content.loops["FIC1"].samples == ROWS - 1


def test_names_that_come_again_are_no_data(read: Read) -> None:
    lines = wide("Year,Month,Day,Hour,Minute,Second", "{0:%Y,%m,%d,%H,%M,%S}".format, 1).splitlines()
    content = read("\n".join((*lines[:30], lines[0], *lines[30:])) + "\n")
    assert times_of(content.loops["FIC1"]) == expected_ns(1)


@pytest.mark.parametrize("name", ["Hours", "Hour"])
def test_hours_that_something_ran_are_no_clock(read: Read, name: str) -> None:
    rows = [f"2024-05-{day:02d},{20 + day % 5},{day},{day % 7}" for day in range(1, 31)]
    content = read(f"Date,{name},FIC1.PV,FIC1.OP\n" + "\n".join(rows))
    assert content.loops["FIC1"].time_ns.tolist() == expected_ns(86_400, 30)


@pytest.mark.parametrize("heading", ["Date,Tag,Value,Hours", "Date,Loop,PV,OP,Hours"])
@pytest.mark.parametrize("hours", [lambda k: 24 - k % 17 // 16, lambda k: 20 + k % 4], ids=["mostly 24", "a loop"])
def test_hours_that_several_ran_a_day_are_no_clock(read: Read, heading: str, hours: Callable[[int], int]) -> None:
    tags = ("FIC1.PV", "FIC1.OP", "FIC2.PV", "FIC2.OP") if "Tag" in heading else ("FIC1", "FIC2", "FIC3", "FIC4")
    between = "" if "Tag" in heading else ",5.5"
    rows = [f"2024-05-{k // 4 + 1:02d},{tags[k % 4]},{k % 9}.5{between},{hours(k)}" for k in range(120)]
    content = read("\n".join((heading, *rows)) + "\n")
    assert content.loops["FIC1"].time_ns.tolist() == expected_ns(86_400, 30)
    assert content.loops["FIC2"].time_ns.tolist() == expected_ns(86_400, 30)


def test_hours_that_something_ran_beside_year_month_and_day_are_no_clock(read: Read) -> None:
    rows = [f"2024,5,{day},{20 + day % 5},{day},{day % 7}" for day in range(1, 31)]
    with pytest.raises(DataError):
        read("Year,Month,Day,Hours,FIC1.PV,FIC1.OP\n" + "\n".join(rows))


def test_dates_of_the_year_2000_keep_their_year(read: Read) -> None:
    start = datetime(2000, 5, 1)
    times = [start + timedelta(minutes=k) for k in range(ROWS)]
    rows = [f"{at:%d.%m.%y};{at.hour};{at.minute};{k % 9};{k % 7}" for k, at in enumerate(times)]
    content = read("Datum;Stunde;Minute;FIC1.PV;FIC1.OP\n" + "\n".join(rows))
    assert content.loops["FIC1"].time_ns.tolist() == expected_ns(60, start=start)


def test_hours_of_several_tags_are_a_clock(read: Read) -> None:
    times = [START + timedelta(hours=k) for k in range(ROWS)]
    rows = [f"{at:%Y-%m-%d},{at.hour},FIC1.{tag},{k % 9}" for k, at in enumerate(times) for tag in ("PV", "OP")]
    content = read("Date,Hour,Tag,Value\n" + "\n".join(rows))
    assert content.loops["FIC1"].time_ns.tolist() == expected_ns(HOUR_S)


def test_minimum_beside_maximum_is_no_minute(read: Read) -> None:
    content = read(wide("Date,Hour,Min,Max", lambda at: f"{at:%Y-%m-%d},{at.hour},{at.hour},{at.hour + 9}", HOUR_S))
    assert times_of(content.loops["FIC1"]) == expected_ns(HOUR_S)


def test_a_stamp_goes_before_its_parts(read: Read) -> None:
    names = "Sampled at,Year,Month,Day,Hour"
    content = read(wide(names, "{0:%Y-%m-%d %H:%M:%S},{0:%Y,%m,%d,%H}".format, 10))
    assert times_of(content.loops["FIC1"]) == expected_ns(10)


def test_counted_instants_go_before_hours(read: Read) -> None:
    first = expected_ns(10)[0] // 10**9

    def stamp(at: datetime) -> str:
        return f"{first + (at - START).seconds},{at:%Y-%m-%d},{at.hour}"

    assert times_of(read(wide("Timestamp,Date,Time", stamp, 10)).loops["FIC1"]) == expected_ns(10)


def test_hours_that_many_rows_share_are_refused(read: Read) -> None:
    with pytest.raises(DataError, match="hours without minutes, '2024-05-01 0' the first") as error:
        read(wide("Date,Hour", "{0:%Y-%m-%d},{0.hour}".format, 60, rows=240))
    assert error.value.code == "unknown_layout"


def test_a_count_beside_a_date_is_no_hour(read: Read) -> None:
    rows = [f"2024-05-01,{k},{k % 9},{k % 7}" for k in range(ROWS)]
    with pytest.raises(DataError):
        read("Date,Time,FIC1.PV,FIC1.OP\n" + "\n".join(rows))


def test_explain_reads_them_alike() -> None:
    table = parse_named(wide("Date,Hour,Minute", "{0:%Y-%m-%d},{0.hour},{0.minute}".format, 60), IngestOptions())
    assert table.time_columns == ("Date", "Hour", "Minute")
    times = table.times_s()
    assert times is not None
    assert (times * 1e9).astype(np.int64).tolist() == expected_ns(60)


MIDNIGHTS = ["{0} 24:00:00", "{0} 24:00", "{0}T24:00:00"]


def at_24(at: datetime, form: str) -> str:
    if at.hour or at.minute:
        return f"{at:%Y-%m-%d %H:%M:%S}".replace(" ", "T" if "T" in form else " ")
    return form.format(f"{at - timedelta(days=1):%Y-%m-%d}")


@pytest.mark.parametrize("form", MIDNIGHTS)
def test_24_is_the_midnight_that_ends_a_day(read: Read, form: str) -> None:
    content = read(wide("Time", lambda at: at_24(at, form), HOUR_S))
    assert times_of(content.loops["FIC1"]) == expected_ns(HOUR_S)
    assert not content.rejects.counts


def test_24_in_the_zone_of_its_clock(read: Read) -> None:
    content = read(wide("Time", lambda at: at_24(at, MIDNIGHTS[0]) + "+02:00", HOUR_S))
    assert times_of(content.loops["FIC1"]) == expected_ns(HOUR_S, start=START - timedelta(hours=2))


def test_24_in_a_table_of_a_tag_a_row_and_in_two_columns(read: Read) -> None:
    times = [at_24(START + timedelta(hours=k), MIDNIGHTS[0]) for k in range(ROWS)]
    rows = [f"{at};{s};{k % 9}" for k, at in enumerate(times) for s in ("FIC1.PV", "FIC1.OP")]
    assert read("Time;Tag;Value\n" + "\n".join(rows)).loops["FIC1"].time_ns.tolist() == expected_ns(HOUR_S)
    rows = [f"{at.replace(' ', ';')};{k % 9};{k % 7}" for k, at in enumerate(times)]
    assert read("Date;Time;FIC1.PV;FIC1.OP\n" + "\n".join(rows)).loops["FIC1"].time_ns.tolist() == expected_ns(HOUR_S)


@pytest.mark.parametrize("newest_first", [False, True])
def test_24_that_begins_its_day_is_refused(read: Read, newest_first: bool) -> None:
    def stamp(at: datetime) -> str:
        return f"{at:%Y-%m-%d} {'24' if not at.hour else f'{at:%H}'}:{at:%M:%S}"

    names, *rows = wide("Time", stamp, HOUR_S).splitlines()
    content = read("\n".join((names, *(rows[::-1] if newest_first else rows))) + "\n")
    assert dict(content.rejects.counts) == {"bad_time": 3}, "that of the first row is as the others are"


@pytest.mark.parametrize("by_tag", [False, True])
def test_24_that_begins_its_day_is_refused_in_a_table_of_a_tag_a_row(read: Read, by_tag: bool) -> None:
    def stamp(at: datetime) -> str:
        return f"{at:%Y-%m-%d} {at.hour or 24:02d}:{at:%M:%S}"

    times = [stamp(START + timedelta(hours=k)) for k in range(ROWS)]
    rows = [(tag, k) for tag in ("PV", "OP") for k in range(ROWS)]
    rows.sort(key=lambda row: 0 if by_tag else row[1])
    content = read("Time,Tag,Value\n" + "\n".join(f"{times[k]},FIC1.{tag},{k % 9}" for tag, k in rows))
    assert dict(content.rejects.counts) == {"bad_time": 6}


def test_24_beside_times_of_its_hour_that_are_none_is_refused(read: Read) -> None:
    times = [START + timedelta(minutes=30 * k) for k in range(120)]
    rows = [f"{at:%Y-%m-%d} {at.hour or 24:02d}:{at:%M:%S},{k % 9},{k % 7}" for k, at in enumerate(times)]
    content = read("Time,FIC1.PV,FIC1.OP\n" + "\n".join(rows))
    assert dict(content.rejects.counts) == {"bad_time": 6}


def test_one_24_out_of_its_order_leaves_the_others(read: Read) -> None:
    times = [at_24(START + timedelta(hours=k), MIDNIGHTS[0]) for k in range(10 * 24)]
    times[49], times[72] = times[72], times[49]
    content = read("Time,FIC1.PV,FIC1.OP\n" + "\n".join(f"{at},{k % 9},{k % 7}" for k, at in enumerate(times)))
    assert dict(content.rejects.counts) == {}


def test_24_with_minutes_is_no_time(read: Read) -> None:
    lines = wide("Time", "{0:%Y-%m-%d %H:%M:%S}".format, HOUR_S).splitlines()
    lines[25] = lines[25].replace("00:00:00", "24:00:01")
    assert dict(read("\n".join(lines) + "\n").rejects.counts) == {"bad_time": 1}
