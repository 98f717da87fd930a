"""Times as regional settings spell them: a.m., narrow blanks, months in full, UTC in letters."""

from collections import Counter
from collections.abc import Callable
from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from app.errors import DataError
from app.ingest import IngestOptions, parse_named
from app.ingest.times.spelled_times import _ENGLISH, _NAMES, respelled

from .conftest import Read

TIMES = [datetime(2026, 10, 30, 9) + timedelta(minutes=20 * i) for i in range(300)]
AT = np.array(TIMES, dtype="datetime64[ns]").astype(np.int64)
GERMAN = {10: "Oktober", 11: "November"}
FRENCH = {10: "octobre", 11: "nov."}
SPANISH = {10: "octubre", 11: "noviembre"}
HALF = {False: "a.m.", True: "p.m."}


def table(stamp: Callable[[datetime], str], names: str = "Time;A.PV;A.OP") -> str:
    return f"{names}\n" + "".join(f"{stamp(time)};{i};1{i}\n" for i, time in enumerate(TIMES))


def clock(time: datetime) -> str:
    return f"{time:%H:%M:%S}"


@pytest.mark.parametrize(
    "stamp",
    [
        lambda t: f"{t:%m/%d/%Y %I:%M:%S} {HALF[t.hour >= 12]}",
        lambda t: f"{t:%m/%d/%Y %I:%M:%S\u202f%p}",
        lambda t: f"{t:%m/%d/%Y %I:%M:%S\xa0%p}",
        lambda t: f"{t:%m/%d/%Y %I:%M:%S%p}",
        lambda t: f"{t:%m/%d/%Y, %I:%M:%S\u202f%p}",
        lambda t: f"{t:%d/%m/%Y %I:%M:%S}\xa0{HALF[t.hour >= 12].replace('.', '.' + chr(0xA0), 1)}",
        lambda t: f"{t:%d/%m/%Y, %H:%M:%S}",
        lambda t: f"{t:%d %B %Y %H:%M:%S}",
        lambda t: f"{t:%d-%B-%y %H:%M}",
        lambda t: f"{t:%B} {t.day}, {t:%Y} at {t:%I:%M:%S\u202f%p}",
        lambda t: f"{t:%A, %B %d, %Y %I:%M:%S %p}",
        lambda t: f"{t.day}. {GERMAN[t.month]} {t:%Y} um {clock(t)} Uhr",
        lambda t: f"{t.day} {FRENCH[t.month]} {t:%Y} \u00e0 {clock(t)}",
        lambda t: f"{t:%A}, {t.day} de {SPANISH[t.month]} de {t:%Y}, {clock(t)}",
        lambda t: f"{t:%d%b%Y:%H:%M:%S}".upper(),
        lambda t: f"{t:%Y-%b-%d %H:%M:%S}",
    ],
)
def test_spellings_of_a_clock_on_the_wall(read: Read, stamp: Callable[[datetime], str]) -> None:
    content = read(table(stamp))
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT)
    assert content.rejects.total == 0


@pytest.mark.parametrize(
    ("stamp", "hours"),
    [
        (lambda t: f"{t:%Y-%m-%d %H:%M:%S} UTC", 0),
        (lambda t: f"{t:%Y-%m-%d %H:%M:%S.%f} (UTC)", 0),
        (lambda t: f"{t:%a, %d %b %Y %H:%M:%S} GMT", 0),
        (lambda t: f"{t:%d-%b-%y %H:%M:%S} gmt", 0),
        (lambda t: f"{t:%Y-%m-%d %H:%M:%S} UTC+1", 1),
        (lambda t: f"{t:%m/%d/%Y %I:%M:%S %p} UTC-03:30", -3.5),
        (lambda t: f"{t:%a %b %d %Y %H:%M:%S} GMT+0100 (Central European Standard Time)", 1),
    ],
)
def test_a_zone_in_letters_goes_before_the_one_of_the_options(
    read: Read, stamp: Callable[[datetime], str], hours: float
) -> None:
    content = read(table(stamp), options=IngestOptions(time_zone="Asia/Tokyo"))
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT - int(hours * 3600) * 10**9)
    assert content.summary.time_zone == "in the file"
    assert "UTC or GMT stands behind the times" in content.summary.notes[0]
    assert content.rejects.total == 0


@pytest.mark.parametrize(
    ("stamp", "hours"),
    [
        (lambda t: f"{t:%Y-%m-%d %H:%M:%S},123", 0),
        (lambda t: f"{t:%d.%m.%Y %H:%M:%S},123", 0),
        (lambda t: f"{t:%d.%m.%Y};{t:%H:%M:%S},123", 0),
        (lambda t: f"{t:%Y-%m-%dT%H:%M:%S},123+01:00", 1),
        (lambda t: f"{t:%Y-%m-%dT%H:%M:%S},123000000Z", 0),
        (lambda t: f"{t:%Y%m%dT%H%M%S}.123", 0),
        (lambda t: f"{t:%Y%m%dT%H%M%S}.123Z", 0),
        (lambda t: f"{t:%Y%m%dT%H%M%S}.123+0100", 1),
        (lambda t: f"{t:%Y%m%d%H%M%S}.123", 0),
        (lambda t: f"{t:%Y%m%d %H%M%S}.123", 0),
        (lambda t: f"{t.day}. {GERMAN[t.month]} {t:%Y} {clock(t)},123", 0),
        (lambda t: f"{t:%d.%m.%Y %H:%M:%S}{',123' if t.hour != 9 else '.123'}", 0),
    ],
)
def test_decimals_of_seconds(read: Read, stamp: Callable[[datetime], str], hours: int) -> None:
    names = "Datum;Uhrzeit;A.PV;A.OP" if ";" in stamp(TIMES[0]) else "Time;A.PV;A.OP"
    content = read(table(stamp, names))
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT - hours * 3600 * 10**9 + 123 * 10**6)
    assert content.rejects.total == 0


def test_whole_seconds_first_and_a_decimal_comma_later(read: Read) -> None:
    text = table(lambda t: f"{t:%d.%m.%Y %H:%M:%S}{',5' if t > TIMES[280] else ''}")
    np.testing.assert_array_equal(read(text).loops["A"].time_ns[[0, -1]], AT[[0, -1]] + [0, 5 * 10**8])


def test_other_zones_in_letters_are_refused(read: Read) -> None:
    with pytest.raises(DataError, match="no row has a time that can be read"):
        read(table(lambda t: f"{t:%Y-%m-%d %H:%M:%S} CST"))


def test_a_dotted_half_of_the_day_tells_no_american_date(read: Read) -> None:
    stamps = [f"05/11/2026 {hour}:{minute:02d} a.m." for hour in range(1, 10) for minute in range(60)]
    content = read("Time;A.PV;A.OP\n" + "".join(f"{stamp};{i};1{i}\n" for i, stamp in enumerate(stamps)))
    assert content.loops["A"].time_ns[0] == np.datetime64("2026-11-05T01:00", "ns").astype(np.int64)
    assert "`--date-order month` reads" in content.summary.notes[0]


def test_months_that_are_spelled_in_full_from_some_row_on(read: Read) -> None:
    days = [f"{time:%d %B %Y %H:%M:%S}" for time in (datetime(2026, 5, 20) + timedelta(hours=i) for i in range(600))]
    content = read("Time;A.PV;A.OP\n" + "".join(f"{day};{i};1{i}\n" for i, day in enumerate(days)))
    assert np.all(np.diff(content.loops["A"].time_ns) == 3600 * 10**9)
    assert content.loops["A"].samples == 600


def test_dates_and_clocks_in_two_columns(read: Read) -> None:
    text = table(lambda t: f"{t:%d %B %Y};{t:%I:%M:%S\u202f%p}", "Tag;Uhrzeit;A.PV;A.OP")
    np.testing.assert_array_equal(read(text).loops["A"].time_ns, AT)


def test_stamps_that_are_cut_to_the_minute(read: Read) -> None:
    rows = "".join(f"12 November 2026 05:{i // 6:02d};{i};1{i}\n" for i in range(300))
    steps = np.diff(read(f"Time;A.PV;A.OP\n{rows}").loops["A"].time_ns)
    assert np.all(steps == 10 * 10**9)


def test_tables_of_simulations() -> None:
    named = parse_named("time;x\n12 November 2026 05:00:00;1\n12 November 2026 05:00:10;2\n", IngestOptions())
    times = named.times_s()
    assert times is not None
    assert np.diff(times).tolist() == [10.0]


def test_no_name_is_that_of_two_months() -> None:
    months: dict[str, set[str]] = {}
    for names in _NAMES:
        for name, short in zip(names.split(), _ENGLISH, strict=True):
            months.setdefault(name, set()).add(short)
    del months["-"]
    assert Counter(map(len, months.values())).keys() == {1}


def test_what_is_no_stamp_stays() -> None:
    texts = pl.Series(["FIC101", "36.4 %", None, "2026-11-12", "good"])
    assert respelled(texts).to_list() == texts.to_list()


@pytest.mark.parametrize("form", ["%d.%m.%Y %H:%M:%S:000", "%Y年%m月%d日 %H:%M:%S", "%Y年%m月%d日 %H时%M分%S秒"])
def test_thousandths_behind_a_colon_and_signs_for_year_month_and_day(read: Read, form: str) -> None:
    content = read(table(lambda time: f"{time:{form}}"))
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT)
    assert content.rejects.total == 0


@pytest.mark.parametrize(("zone", "hours"), [("+00", 0), (".000+01", 1), (".000000-05", -5), ("+0530", 5.5)])
def test_the_hours_alone_of_an_offset(read: Read, zone: str, hours: float) -> None:
    content = read(table(lambda time: f"{time:%Y-%m-%d %H:%M:%S}{zone}"))
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT - round(hours * 3600 * 10**9))
    assert content.summary.time_zone == "in the file"


@pytest.mark.parametrize(
    ("stamp", "hours"),
    [
        (lambda t: f"{t:%Y-%m-%d %H:%M:%S} +0000", 0),
        (lambda t: f"{t:%Y-%m-%d %H:%M:%S.%f} -03:30", -3.5),
        (lambda t: f"{t:%Y-%m-%d %H:%M:%S} CET", 1),
        (lambda t: f"{t:%d.%m.%Y %H:%M:%S} MESZ", 2),
        (lambda t: f"{t:%m/%d/%Y %H:%M:%S} PDT", -7),
        (lambda t: f"{t:%a %b %d %H:%M:%S} UTC {t:%Y}", 0),
        (lambda t: f"{t:%a %b %d %H:%M:%S} EDT {t:%Y}", -4),
    ],
)
def test_offsets_behind_a_blank_and_zones_of_one_offset(
    read: Read, stamp: Callable[[datetime], str], hours: float
) -> None:
    content = read(table(stamp), options=IngestOptions(time_zone="Asia/Tokyo"))
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT - int(hours * 3600) * 10**9)
    assert content.summary.time_zone == "in the file"


def test_both_zones_of_a_year(read: Read) -> None:
    changes = datetime(2026, 11, 1, 9)
    content = read(table(lambda t: f"{t:%Y-%m-%d %H:%M:%S} {'CEST' if t < changes else 'CET'}"))
    first = np.array(TIMES) < changes
    np.testing.assert_array_equal(content.loops["A"].time_ns, AT - np.where(first, 2, 1) * 3600 * 10**9)


@pytest.mark.parametrize(
    "stamp",
    [
        lambda t: f"{t:%a %b %d %H:%M:%S %Y}",
        lambda t: f"{t:%d-%b-%y} {t:%I.%M.%S}.000000000 {t:%p}".upper(),
        lambda t: f"{t:%d-%b-%Y} {t:%I.%M.%S %p}",
    ],
)
def test_stamps_of_java_and_of_oracle(read: Read, stamp: Callable[[datetime], str]) -> None:
    np.testing.assert_array_equal(read(table(stamp)).loops["A"].time_ns, AT)


@pytest.mark.parametrize(("form", "lacks"), [("%I:%M:%S", True), ("%H:%M:%S", False), ("%I:%M:%S %p", False)])
@pytest.mark.parametrize("options", [IngestOptions(), IngestOptions(chunk_bytes=2000)])
def test_a_clock_of_twelve_hours_without_its_half_is_told(
    read: Read, form: str, lacks: bool, options: IngestOptions
) -> None:
    content = read(table(lambda t: f"{t:%Y-%m-%d} {t.strftime(form)}"), options=options)
    assert any("nothing tells AM from PM" in note for note in content.summary.notes) is lacks
    long = "Tag,Time,Value\n" + "".join(
        f"A.{signal},{time:%Y-%m-%d} {time.strftime(form)},{i}\n"
        for i, time in enumerate(TIMES)
        for signal in ("PV", "OP")
    )
    content = read(long, options=options)
    assert any("nothing tells AM from PM" in note for note in content.summary.notes) is lacks


def half_seconds(k: int) -> str:
    """The clock's second of a row, of two a second."""
    return f"06:00:{k // 2:02d}"


@pytest.mark.parametrize("mark", [";", ":"])
def test_milliseconds_behind_a_mark_of_logix(read: Read, mark: str) -> None:
    rows = [f"01/31/2024,{half_seconds(k)}{mark}{500 * (k % 2):03d},{k % 9}.5,{k % 7}.5" for k in range(60)]
    content = read("Date,Time,FIC1.PV,FIC1.OP\n" + "\n".join(rows))
    assert np.unique(np.diff(content.loops["FIC1"].time_ns)).tolist() == [500_000_000]
    assert content.loops["FIC1"].time_ns[0] == np.datetime64("2024-01-31T06:00:00", "ns").astype(np.int64)


@pytest.mark.parametrize("mark", [";", ":"])
def test_the_same_behind_date_and_clock_in_one(read: Read, mark: str) -> None:
    rows = [f'"01/31/2024 {half_seconds(k)}{mark}{500 * (k % 2):03d}","{k % 9}.5","{k % 7}.5"' for k in range(60)]
    content = read('"Time","FIC1.PV","FIC1.OP"\n' + "\n".join(rows))
    assert np.unique(np.diff(content.loops["FIC1"].time_ns)).tolist() == [500_000_000]


@pytest.mark.parametrize("word", ["", "Data:,"])
def test_the_same_below_lines_about_the_trend(read: Read, word: str) -> None:
    names = f"{'Header:,' if word else ''}Date,Time,Program:Main.FIC1.PV,Program:Main.FIC1.CV\n"
    about = "Controller Name:,L71\nTrend Name:,FIC1\nTrend Tags:,2\nSample Period:,500 ms\n"
    rows = [f"{word}01/31/2024,{half_seconds(k)};{500 * (k % 2):03d},{k % 9}.5,{k % 7}.5" for k in range(60)]
    loop = read(about + names + "\n".join(rows)).loops["Program:Main.FIC1"]
    assert np.unique(np.diff(loop.time_ns)).tolist() == [500_000_000]
    assert loop.op is not None


def test_a_number_of_three_digits_behind_a_semicolon_is_no_part_of_a_time(read: Read) -> None:
    content = read("\n".join(f"31.01.2024 06:00:{k:02d};250,{k % 7}" for k in range(60)), "FIC1.PV.csv")
    assert content.loops["FIC1"].pv is not None
    assert content.loops["FIC1"].pv[:3].tolist() == [250.0, 250.1, 250.2]


def test_semicolons_between_fields_stay_delimiters(read: Read) -> None:
    rows = [f"31.01.2024 06:00:{k:02d};250;{k % 7},5" for k in range(60)]
    content = read("Time;FIC1.PV;FIC1.OP\n" + "\n".join(rows))
    assert content.loops["FIC1"].pv is not None
    assert set(content.loops["FIC1"].pv.tolist()) == {250.0}
    assert np.unique(np.diff(content.loops["FIC1"].time_ns)).tolist() == [1_000_000_000]


def hours_apart(tag: str, hours: list[int]) -> list[str]:
    """Rows of a tag with a column of hours, every ten minutes."""
    return [f"FIC1.{tag},01/31/2024,{hour},{minute},{minute / 10}" for hour in hours for minute in range(0, 60, 10)]


@pytest.mark.parametrize("hours", [list(range(1, 13)), list(range(12, 0, -1))])
def test_another_tag_that_begins_again_tells_nothing_of_am_and_pm(read: Read, hours: list[int]) -> None:
    rows = [row for tag in ("PV", "OP", "SP") for row in hours_apart(tag, hours)]
    content = read("tag,date,hour,minute,value\n" + "\n".join(rows))
    assert content.loops["FIC1"].samples == 72
    assert not [note for note in content.summary.notes if "AM from PM" in note]


@pytest.mark.parametrize("buffered_values", [12_000_000, 300])
def test_hours_of_a_tag_that_begin_again_do_so(read: Read, buffered_values: int) -> None:
    rows = [row for tag in ("PV", "OP", "SP") for row in hours_apart(tag, [12, *range(1, 13), *range(1, 12)])]
    options = IngestOptions(buffered_values=buffered_values, chunk_bytes=1_000)
    with pytest.raises(DataError, match="nothing tells AM from PM; needed are hours from 0 to 23"):
        read("tag,date,hour,minute,value\n" + "\n".join(rows), options=options)


@pytest.mark.parametrize("day", ["Jan 31, 2024", "1/31/2024,"])
def test_a_day_with_a_comma_before_a_value_with_one(read: Read, day: str) -> None:
    """`06:00:00;415,5` is no clock with milliseconds there."""
    rows = [f"{day} 06:00:{k:02d};{400 + k},5" for k in range(60)]
    content = read("Time;FIC1.PV\n" + "\n".join(rows))
    assert content.loops["FIC1"].pv is not None
    assert content.loops["FIC1"].pv[:2].tolist() == [400.5, 401.5]


@pytest.mark.parametrize(
    "form", ["{day} {clock} {half}", "{day} {clock}{half}", "{day} {half} {clock}", "{day} {half}{clock}"]
)
@pytest.mark.parametrize("halves", ["上午 下午", "오전 오후", "午前 午後"])
def test_halves_of_the_day_in_chinese_and_korean(read: Read, form: str, halves: str) -> None:
    at = [9 * 60 + k for k in range(300)]
    stamps = (
        form.format(day="2024/3/13", clock=f"{(m // 60 - 1) % 12 + 1}:{m % 60:02d}:00", half=halves.split()[m >= 720])
        for m in at
    )
    content = read(
        "Time,FIC1.PV,FIC1.OP\n" + "".join(f"{stamp},5{k % 7}.5,4{k % 5}.5\n" for k, stamp in enumerate(stamps))
    )
    start = np.datetime64("2024-03-13T09:00", "ns").astype(np.int64)
    assert content.loops["FIC1"].time_ns.tolist() == [start + k * 60 * 10**9 for k in range(300)]


@pytest.mark.parametrize("half", ["μμ", "ΜΜ", "μ.μ.", "Μ.Μ."])
def test_halves_of_the_day_in_greek(read: Read, half: str) -> None:
    rows = (f"13/03/2024 {k // 60 + 1:02d}:{k % 60:02d}:00 {half},5{k % 7}.5,4{k % 5}.5\n" for k in range(300))
    content = read("Time,FIC1.PV,FIC1.OP\n" + "".join(rows))
    assert content.loops["FIC1"].time_ns[0] == np.datetime64("2024-03-13T13:00", "ns").astype(np.int64)
    assert content.loops["FIC1"].samples == 300
