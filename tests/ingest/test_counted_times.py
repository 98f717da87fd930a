"""Times that are numbers: since when they count, and how finely."""

from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from app.errors import DataError
from app.ingest import IngestOptions

from .conftest import Read
from .test_tables import parquet

FIRST = datetime(2026, 3, 1, 22)
TIMES = [FIRST + timedelta(seconds=10 * i) for i in range(300)]
START = np.datetime64(FIRST, "ns").astype(np.int64)


def since(origin: datetime, unit: timedelta) -> list[float]:
    return [(time - origin) / unit for time in TIMES]


def ticks(origin: datetime) -> list[str]:
    return [str((time - origin) // timedelta(microseconds=1) * 10) for time in TIMES]


def table(texts: list[str], name: str = "Time") -> str:
    return f"{name},A.PV,A.OP\n" + "".join(f"{text},{i},1{i}\n" for i, text in enumerate(texts))


DAYS = since(datetime(1899, 12, 30), timedelta(days=1))
MATLAB = [day + 693_960 for day in DAYS]


@pytest.mark.parametrize(
    ("texts", "note"),
    [
        (ticks(datetime(1601, 1, 1)), "100 ns since 1601, as Windows counts them (FILETIME)"),
        (ticks(datetime(1, 1, 1)), "100 ns since year 1, as .NET counts them"),
        ([repr(day) for day in DAYS], "days since 1899-12-30"),
        ([f"{day:.5f}" for day in DAYS], "days since 1899-12-30"),
        ([f"{day:.8f}" for day in DAYS], "days since 1899-12-30"),
        ([repr(day) for day in MATLAB], "days since year 0, as MATLAB counts them"),
        ([f"{day:.6f}" for day in MATLAB], "days since year 0, as MATLAB counts them"),
    ],
)
def test_counts_of_ticks_and_days(read: Read, texts: list[str], note: str) -> None:
    content = read(table(texts))
    assert (content.loops["A"].time_ns - START).tolist() == [i * 10**10 for i in range(300)]
    (told,) = content.summary.notes
    assert note in told


def test_days_are_of_the_clock_on_the_wall(read: Read) -> None:
    berlin = IngestOptions(time_zone="Europe/Berlin")
    assert read(table([repr(day) for day in DAYS]), options=berlin).loops["A"].time_ns[0] == START - 3600 * 10**9
    ticks_of_windows = table(ticks(datetime(1601, 1, 1)))
    assert read(ticks_of_windows, options=berlin).loops["A"].time_ns[0] == START


def test_days_written_too_short_are_told(read: Read) -> None:
    days = [f"{day:.4f}" for day in DAYS[::10]]
    assert "times are written to 8.64 s only" in read(table(days)).summary.notes


@pytest.mark.parametrize("unit", [timedelta(seconds=1), timedelta(milliseconds=1)])
def test_seconds_lost_in_scientific_numbers_are_refused(read: Read, unit: timedelta) -> None:
    seconds = since(datetime(1970, 1, 1), unit)
    with pytest.raises(DataError) as refused:
        read(table([f"{second:.6E}" for second in seconds]))
    assert refused.value.code == "unknown_layout"
    assert "no row has a time that can be read; the first of them is '1.772402E+" in str(refused.value)
    whole = read(table([f"{second:.12E}" for second in seconds]))
    assert whole.loops["A"].time_ns[-1] - START == 2990 * 10**9


def test_numbers_of_a_typed_table_have_all_their_digits(read: Read) -> None:
    """Which are shown as 1.7724024e9."""
    seconds = [(time - datetime(1970, 1, 1)).total_seconds() for time in TIMES[::30]]
    frame = pl.DataFrame({"Time": seconds, "A.PV": seconds, "A.OP": seconds})
    assert np.diff(read(parquet(frame), name="a.parquet").loops["A"].time_ns).tolist() == [300 * 10**9] * 9
