"""Dates without a clock are no times of rows that share them, and times where each row has its own."""

from collections.abc import Callable

import numpy as np
import pytest

from app.errors import DataError

from .conftest import Read

NS_PER_DAY = 86_400_000_000_000


def day(k: int) -> str:
    return f"2024-01-{1 + k:02d}"


def wide(heading: str, row: Callable[[int], str], rows: int = 200) -> str:
    return heading + "\n" + "".join(f"{row(k)},{k % 9}.5,{k % 7}.5\n" for k in range(rows))


REFUSED = [
    ("Date,PV,OP", lambda k: day(0)),
    ("Date,PV,OP", lambda k: day(k // 20)),
    ("Time,PV,OP", lambda k: f"{day(k // 50)} 00:00:00"),
    ("Date,Hour,PV,OP", lambda k: f"{day(0)},6"),
    ("Date,Shift,Min,Sec,PV,OP", lambda k: f"{day(0)},6,{k // 60},{k % 60}"),
    ("Date,Seconds,PV,OP", lambda k: f"{day(0)},{21600 + k}"),
]


@pytest.mark.parametrize(("heading", "row"), REFUSED)
def test_rows_of_a_day_without_a_clock_are_refused(read: Read, heading: str, row: Callable[[int], str]) -> None:
    with pytest.raises(DataError, match="dates without a clock, '2024-01-01") as error:
        read(wide(heading, row))
    assert error.value.code == "unknown_layout"


def test_a_table_of_tags_is_refused_too(read: Read) -> None:
    rows = [f"FIC1.{word},{day(k // 20)},{k % 9}.5" for k in range(200) for word in ("PV", "OP")]
    with pytest.raises(DataError, match="dates without a clock"):
        read("Tag,Date,Value\n" + "\n".join(rows))


def test_a_row_a_day_has_times(read: Read) -> None:
    content = read(wide("Date,PV,OP", day, rows=31), name="F1.csv")
    assert np.unique(np.diff(content.loops["F1"].time_ns)).tolist() == [NS_PER_DAY]


def test_many_tags_of_a_day_have_times(read: Read) -> None:
    rows = [f"FIC{n}.{word},{day(k)},{k % 9}.5" for k in range(31) for n in range(4) for word in ("PV", "OP")]
    content = read("Tag,Date,Value\n" + "\n".join(rows))
    assert [content.loops[f"FIC{n}"].samples for n in range(4)] == [31] * 4


def test_a_clock_or_seconds_beside_the_date_tell_the_times(read: Read) -> None:
    for heading, text in (
        ("Date,Clock,PV,OP", "{day},06:{k:02d}:00"),
        ("time_s,Date,PV,OP", "{k},{day}"),
        ("Date,Hour,Min,Sec,PV,OP", "{day},6,0,{k}"),
    ):
        content = read(wide(heading, lambda k, text=text: text.format(k=k, day=day(0)), rows=50), name="F1.csv")
        assert content.loops["F1"].samples == 50
        assert len(np.unique(np.diff(content.loops["F1"].time_ns))) == 1


def test_a_record_may_begin_with_many_rows_of_midnight(read: Read) -> None:
    """Cut to the minute, ten a second."""
    content = read(wide("Time,PV,OP", lambda k: f"{day(0)} 00:{k // 600:02d}:00", rows=3000), name="F1.csv")
    assert np.unique(np.diff(content.loops["F1"].time_ns)).tolist() == [100_000_000]


def test_a_day_that_is_sent_over_and_over_has_its_time(read: Read) -> None:
    content = read("Date,PV,OP\n" + "2024-01-01,1,2\n" * 50, name="F1.csv")
    assert content.loops["F1"].samples == 1


@pytest.mark.parametrize("heading", ["Loop,Signal,Date,Value", "_measurement,_field,_time,_value"])
def test_signals_of_a_day_in_a_column_of_words_have_times(read: Read, heading: str) -> None:
    words = ("PV", "OP", "SP", "MODE")
    rows = [f"FIC{n},{word},{day(k)},{k % 9}.5" for k in range(31) for n in range(2) for word in words]
    content = read(heading + "\n" + "\n".join(rows))
    assert [content.loops[f"FIC{n}"].samples for n in range(2)] == [31, 31]
