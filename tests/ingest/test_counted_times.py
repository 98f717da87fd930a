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


@pytest.mark.parametrize(
    ("name", "unit_s", "first"),
    [
        ("time_ms", 1e-3, 10**8),
        ("time_us", 1e-6, 10**9),
        ("t [us]", 1e-6, 10**8),
        ("t [us]", 1e-6, 12_345 * 10**6),
        ("time_ns", 1e-9, 12_345 * 10**9),
        ("time [ms]", 1e-3, 5 * 10**10),
        ("time [\u03bcs]", 1e-6, 10**9),
        ("time [\u00b5s]", 1e-6, 10**9),
        ("Time (msec)", 1e-3, 0),
        ("Time [usec]", 1e-6, 0),
        ("TimeMs", 1e-3, 0),
        ("Time (mins)", 60, 0),
        ("Time (min.)", 60, 0),
        ("time/min", 60, 0),
        ("Time (hr)", 3600, 0),
        ("Zeit [Std]", 3600, 0),
        ("Time (d)", 86400, 0),
        ("Time (s)", 1, 0),
        ("time_s", 1, 10**7),
    ],
)
def test_the_unit_in_the_name_goes_before_the_size_of_the_numbers(
    read: Read, name: str, unit_s: float, first: int
) -> None:
    step = max(round(10 / unit_s), 1)
    content = read(table([str(first + k * step) for k in range(300)], name))
    steps = np.unique(np.diff(content.loops["A"].time_ns))
    assert steps.tolist() == [round(step * unit_s * 1e9)]
    assert content.summary.time_format == "relative, s"
    assert content.loops["A"].samples == 300


@pytest.mark.parametrize(
    ("name", "unit"),
    [("Time (s)", timedelta(seconds=1)), ("time_ms", timedelta(milliseconds=1)), ("t [us]", timedelta(microseconds=1))],
)
def test_instants_in_the_unit_of_the_name(read: Read, name: str, unit: timedelta) -> None:
    content = read(table([f"{second:.0f}" for second in since(datetime(1970, 1, 1), unit)], name))
    assert (content.loops["A"].time_ns - START).tolist() == [i * 10**10 for i in range(300)]
    assert content.summary.time_format == "epoch"


@pytest.mark.parametrize("unit", [timedelta(milliseconds=1), timedelta(microseconds=1)])
def test_instants_between_seconds_are_read_to_the_nanosecond(read: Read, unit: timedelta) -> None:
    first = round((FIRST - datetime(1970, 1, 1)) / unit)
    step = timedelta(milliseconds=50) // unit
    content = read(table([str(first + k * step) for k in range(300)]))
    assert (content.loops["A"].time_ns - START).tolist() == [k * 50_000_000 for k in range(300)]


@pytest.mark.parametrize("name", ["Times", "DateTimes", "Timestamp (s)", "Time [ns]", "time_s"])
@pytest.mark.parametrize(
    ("origin", "note"), [(datetime(1601, 1, 1), "as Windows counts"), (datetime(1, 1, 1), "as .NET counts")]
)
def test_ticks_whatever_unit_the_name_seems_to_tell(read: Read, name: str, origin: datetime, note: str) -> None:
    content = read(table(ticks(origin), name))
    assert (content.loops["A"].time_ns - START).tolist() == [i * 10**10 for i in range(300)]
    (told,) = content.summary.notes
    assert note in told


@pytest.mark.parametrize(
    ("name", "text", "note"),
    [
        ("Timestamp_ms", "{:.3f}", "times are s since 1970 by their size, though their column's name tells ms"),
        ("time_ms", "{:.0f}", "times are s since 1970 by their size, though their column's name tells ms"),
        ("time_us", "{:.0f}", "times are s since 1970 by their size, though their column's name tells us"),
        ("time_us", "{:.0f}000", "times are ms since 1970 by their size, though their column's name tells us"),
        ("time_ns", "{:.0f}", "times are s since 1970 by their size, though their column's name tells ns"),
        ("time_ns", "{:.0f}000000", "times are us since 1970 by their size, though their column's name tells ns"),
    ],
)
def test_instants_in_a_coarser_unit_than_that_of_the_name(read: Read, name: str, text: str, note: str) -> None:
    content = read(table([text.format(second) for second in since(datetime(1970, 1, 1), timedelta(seconds=1))], name))
    assert (content.loops["A"].time_ns - START).tolist() == [i * 10**10 for i in range(300)]
    assert content.summary.time_format == "epoch"
    assert content.summary.notes == (note,)


@pytest.mark.parametrize(
    ("name", "first", "step"),
    [("time_ms", 0, 1000), ("time_ms", 1_772_402_400, 1000), ("time_us", 1_000_000_000, 10_000), ("time_us", 0, 10**7)],
)
def test_a_span_in_the_unit_of_the_name_is_no_date(read: Read, name: str, first: int, step: int) -> None:
    content = read(table([str(first + k * step) for k in range(300)], name))
    assert content.summary.time_format == "relative, s"
    assert np.unique(np.diff(content.loops["A"].time_ns)).tolist() == [step * {"m": 10**6, "u": 10**3}[name[5]]]


def test_a_unit_that_is_not_known_is_told(read: Read) -> None:
    assert "'jiffies' in the name of the times is no unit" in read(table(SECONDS, "Time (jiffies)")).summary.notes[0]
    for name in ("Time", "Time (UTC)", "Time (sec)"):
        assert not any("no unit" in note for note in read(table(SECONDS, name)).summary.notes)


SECONDS = [str(10 * i) for i in range(300)]
DATED = [str(1_772_402_400 + 10 * i) for i in range(300)]


@pytest.mark.parametrize(
    ("texts", "odd"),
    [
        (DATED, "0"),
        (DATED, "-1"),
        (DATED, "9999999999"),
        ([f"{text}:5" for text in DATED], "000000000:0"),
        ([repr(day) for day in DAYS], "0"),
    ],
)
def test_numbers_of_absurd_years_are_no_times(read: Read, texts: list[str], odd: str) -> None:
    content = read(table([*texts[:100], odd, *texts[100:]]))
    assert dict(content.rejects.counts) == {"bad_time": 1}
    assert np.unique(np.diff(content.loops["A"].time_ns)).tolist() == [10**10]


def test_numbers_of_absurd_years_in_a_typed_table_are_no_times(read: Read) -> None:
    seconds = [1_772_402_400 + 10 * i for i in range(30)]
    frame = pl.DataFrame({"Time": [*seconds, 0], "A.PV": range(31), "A.OP": range(31)})
    content = read(parquet(frame), name="a.parquet")
    assert dict(content.rejects.counts) == {"bad_time": 1}
    assert content.loops["A"].samples == 30


def test_tenths_of_seconds_since_1970_are_those_of_stamps(read: Read) -> None:
    """Doubles of our time do not hold them."""
    tenths = [FIRST + timedelta(milliseconds=100 * i) for i in range(300)]
    stamps = read(table([time.isoformat(timespec="milliseconds") for time in tenths])).loops["A"].time_ns
    since_1970 = [(time - datetime(1970, 1, 1)) // timedelta(milliseconds=100) for time in tenths]
    assert np.array_equal(read(table([f"{k / 10:.1f}" for k in since_1970])).loops["A"].time_ns, stamps)
    assert np.array_equal(read(table([f"{k}00" for k in since_1970])).loops["A"].time_ns, stamps)
    thousandths = read(table([str(1_772_402_400_000_000_000 + i * 10**6) for i in range(300)])).loops["A"].time_ns
    assert np.unique(np.diff(thousandths)).tolist() == [10**6]


@pytest.mark.parametrize("zone", ["UTC", "Europe/Berlin"])
@pytest.mark.parametrize("decimals", [4, 7])
def test_millionths_of_days_that_wincc_calls_ms(read: Read, zone: str, decimals: int) -> None:
    rows = "".join(
        f'"A.{signal}";{i},5;1;{day * 1e6:.{decimals}f}\n'.replace(".", ",").replace("A,", "A.")
        for i, day in enumerate(DAYS)
        for signal in ("PV", "OP")
    )
    content = read('"VarName";"VarValue";"Validity";"Time_ms"\n' + rows, options=IngestOptions(time_zone=zone))
    ahead = 3600 * 10**9 if zone == "Europe/Berlin" else 0
    assert (content.loops["A"].time_ns - START + ahead).tolist() == [i * 10**10 for i in range(300)]
    (note,) = content.summary.notes
    assert note.startswith("times are millionths of days since 1899-12-30")


def test_whole_milliseconds_of_more_than_a_year_are_a_span(read: Read) -> None:
    content = read(table([str(45_000_000_000 + 10_000 * i) for i in range(300)], "time_ms"))
    assert set(np.diff(content.loops["A"].time_ns).tolist()) == {10**10}


@pytest.mark.parametrize("name", ["Uptime [ms]", "elapsed_ms", "t [ms]", "ms"])
def test_milliseconds_of_more_than_a_year_are_a_span_under_other_names(read: Read, name: str) -> None:
    content = read(table([f"{45_000_000_000 + 1000 * i}.25" for i in range(300)], name))
    assert set(np.diff(content.loops["A"].time_ns).tolist()) == {10**9}
