"""Parts of a second in a column of their own are joined to the times; what looks like them is left a signal."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from app.ingest import TagMapping
from app.ingest.model import LoopSamples
from tests.ingest.conftest import Content, Read

HALF_S = 500_000_000
ROWS = 60


def seconds(k: int) -> str:
    return f"06:{k // 120:02d}:{k // 2 % 60:02d}"


def wide(heading: str, row: Callable[[int], str], rows: int = ROWS) -> str:
    """A file of two rows a second; row: what stands between the stamp and the signals."""
    lines = [f"2024-01-31 {seconds(k)},{row(k)},{50 + k % 9}.25,{40 + k % 7}.5" for k in range(rows)]
    return "\n".join((heading, *lines)) + "\n"


def half_seconds(k: int) -> str:
    return str(500 * (k % 2))


def steps(samples: LoopSamples) -> list[int]:
    return np.unique(np.diff(samples.time_ns)).tolist()


def notes_of(content: Content, word: str) -> list[str]:
    return [note for note in content.summary.notes if word in note]


@pytest.mark.parametrize("name", ["Millitm", "Milliseconds", "MSec", "MSeconds", "ms", "Millisekunden"])
def test_milliseconds_beside_the_time_of_a_wide_file(read: Read, name: str) -> None:
    content = read(wide(f"Time,{name},FIC1.PV,FIC1.OP", lambda k: f"{500 * (k % 2):03d}"))
    assert list(content.loops) == ["FIC1"]
    assert steps(content.loops["FIC1"]) == [HALF_S]
    assert content.loops["FIC1"].pv is not None
    assert content.loops["FIC1"].pv.tolist() == [50.25 + k % 9 for k in range(ROWS)]
    assert content.summary.notes == (f"the parts of a second in '{name}' were joined to the times",)


def test_rows_that_are_not_even_stand_where_their_milliseconds_say(read: Read) -> None:
    parts = (0, 130, 700)
    lines = [f"2024-01-31 06:00:{k // 3:02d},{parts[k % 3]},{k % 7},{k % 5}" for k in range(30)]
    content = read("Time,Millitm,FIC1.PV,FIC1.OP\n" + "\n".join(lines))
    start = np.datetime64("2024-01-31T06:00:00", "ns").astype(np.int64)
    expected = [k // 3 * 1_000_000_000 + parts[k % 3] * 1_000_000 for k in range(30)]
    assert (content.loops["FIC1"].time_ns - start).tolist() == expected


def test_microseconds_by_their_name(read: Read) -> None:
    content = read(wide("Time,Usec,FIC1.PV,FIC1.OP", lambda k: str(500_000 * (k % 2) + 7)))
    start = np.datetime64("2024-01-31T06:00:00.000007", "ns").astype(np.int64)
    assert content.loops["FIC1"].time_ns[0] == start
    assert steps(content.loops["FIC1"]) == [HALF_S]


@pytest.mark.parametrize("name", ["Time_ms", "Time (ms)", "time_msec", "Timestamp [ms]", "TimeMs"])
def test_milliseconds_under_the_name_of_times(read: Read, name: str) -> None:
    content = read(wide(f"Time,{name},FIC1.PV,FIC1.OP", half_seconds))
    assert steps(content.loops["FIC1"]) == [HALF_S]
    assert content.summary.notes == (f"the parts of a second in '{name}' were joined to the times",)
    rows = [f"2024-01-31 {seconds(k)},{half_seconds(k)},{tag},{k % 9}.5" for k in range(ROWS) for tag in SIGNALS]
    content = read(long(rows, f"Time,{name},Tag,Value"))
    assert steps(content.loops["FIC101"]) == [HALF_S]
    assert not content.rejects.counts


@pytest.mark.parametrize("name", ["Time_ms", "Millitm"])
def test_a_few_rows_without_milliseconds_are_refused(read: Read, name: str) -> None:
    content = read(wide(f"Time,{name},FIC1.PV,FIC1.OP", lambda k: "" if k == 20 else half_seconds(k)))
    assert dict(content.rejects.counts) == {"bad_time": 1}
    assert content.loops["FIC1"].samples == ROWS - 1
    start = np.datetime64("2024-01-31T06:00:00", "ns").astype(np.int64)
    assert content.loops["FIC1"].time_ns[-1] - start == (ROWS - 1) * HALF_S


def test_a_count_under_the_name_of_times_stays_one(read: Read) -> None:
    content = read(wide("Time,Time_ms,FIC1.PV,FIC1.OP", lambda k: str(500 * k)))
    assert notes_of(content, "Time_ms") == [
        "columns of further times were not read, neither as times nor as values: Time_ms"
    ]


def test_a_count_under_the_name_of_times_beside_a_tag_a_row_stays_one(read: Read) -> None:
    values = [f"2024-01-31 {seconds(k)},{k % 9}.5,{45322e6 + 5.787 * k:.3f}" for k in range(ROWS)]
    rows = [f"{value},{tag}" for value in values for tag in SIGNALS]
    content = read(long(rows, "TimeString,VarValue,Time_ms,VarName"))
    assert notes_of(content, "Time_ms") == ["columns beside tag, time and value were not read: Time_ms"]


def test_date_clock_and_milliseconds_in_three_columns(read: Read) -> None:
    rows = [f"31/01/2024;{seconds(k)};{half_seconds(k)};{k % 9};{k % 7}" for k in range(ROWS)]
    content = read("Date;Time;Milliseconds;FIC101_PV;FIC101_OP\n" + "\n".join(rows))
    assert list(content.loops) == ["FIC101"]
    assert steps(content.loops["FIC101"]) == [HALF_S]


def long(rows: Sequence[str], heading: str = "Date;Time;Millitm;TagName;Value") -> str:
    return "\n".join((heading, *rows)) + "\n"


SIGNALS = ("FIC101.PV", "FIC101.OP")


def test_a_data_log_of_factorytalk(read: Read) -> None:
    rows = [f"01/31/2024;{seconds(k)};{half_seconds(k)};{tag};{k % 9}.5" for k in range(ROWS) for tag in SIGNALS]
    content = read(long(rows))
    assert content.rejects.counts == {}
    assert steps(content.loops["FIC101"]) == [HALF_S]
    assert content.loops["FIC101"].samples == ROWS


def test_tags_one_after_the_other_newest_first(read: Read) -> None:
    rows = [
        f"01/31/2024;{seconds(k)};{half_seconds(k)};{tag};{k % 9}.5" for tag in SIGNALS for k in reversed(range(ROWS))
    ]
    content = read(long(rows))
    assert content.rejects.counts == {}
    assert steps(content.loops["FIC101"]) == [HALF_S]


def test_numbers_of_tags_go_by_a_mapping(read: Read) -> None:
    rows = [f"2024-01-31 {seconds(k)};{half_seconds(k)};{tag};{k % 9}.5; ; " for k in range(ROWS) for tag in (0, 1)]
    text = long(rows, "DateAndTime;Millitm;TagIndex;Val;Status;Marker")
    assert notes_of(read(text), "a mapping can say it; here is 0, 1")
    mapping = TagMapping.from_bytes(b"tag,loop,signal\n0,FIC7,PV\n1,FIC7,OP\n")
    content = read(text, mapping=mapping)
    assert steps(content.loops["FIC7"]) == [HALF_S]
    assert content.loops["FIC7"].op is not None


def test_names_of_tags_go_before_their_numbers(read: Read) -> None:
    rows = [f"2024-01-31 06:00:{k:02d};{n};Loop7 {word};{k}" for k in range(20) for n, word in enumerate("ab")]
    content = read(long(rows, "DateAndTime;TagIndex;TagName;Val"))
    assert sorted(content.loops) == ["Loop7 a", "Loop7 b"]


def test_a_row_of_a_loop_loses_no_rows(read: Read) -> None:
    rows = [f"{loop};2024-01-31 {seconds(k)};{half_seconds(k)};{k % 9};{k % 7}" for k in range(ROWS) for loop in "AB"]
    content = read("\n".join(("Loop;Time;Milliseconds;PV;OP", *rows)))
    assert content.rejects.counts == {}
    assert sorted(content.loops) == ["A", "B"]
    assert content.loops["A"].others == {}
    assert steps(content.loops["A"]) == [HALF_S]


def test_a_row_without_its_milliseconds_is_refused_with_what_stands_there(read: Read) -> None:
    text = wide("Time,Millitm,FIC1.PV,FIC1.OP", lambda k: "1000" if k == 450 else half_seconds(k), rows=500)
    content = read(text)
    assert content.rejects.counts == {"bad_time": 1}
    assert content.rejects.listed[0].text == "'2024-01-31 06:03:45 with 1000' is no time that can be read"
    assert content.loops["FIC1"].samples == 499


COUNTER_CASES = [
    ("ms", lambda k: f"{20 + k % 3}.5", ""),
    ("ms", lambda k: str(1500 + k), ""),
    ("ms", lambda k: str(120 + k), "within a second"),
    ("ms", lambda k: str(400 + (7 * k) % 11), "within a second"),
    ("Millitm", lambda k: str(1500 + k), "more than whole numbers from 0 to 999"),
    ("Milliseconds", lambda k: f"{k % 2}.5", "more than whole numbers from 0 to 999"),
    ("Milliseconds", lambda k: str(400 + (7 * k) % 11), "within a second"),
]


@pytest.mark.parametrize(("name", "row", "why"), COUNTER_CASES)
def test_what_is_no_part_of_a_second_stays_a_signal(read: Read, name: str, row: Callable[[int], str], why: str) -> None:
    content = read(wide(f"Time,{name},FIC1.PV,FIC1.OP", row))
    assert content.loops[name].others[name].tolist() == [float(row(k)) for k in range(ROWS)]
    assert content.loops["FIC1"].samples == ROWS
    told = notes_of(content, f"the column '{name}' was not joined to the times")
    assert [why in note for note in told] == ([True] if why else [])


def test_stamps_that_have_milliseconds_already(read: Read) -> None:
    rows = [f"2024-01-31 {seconds(k)}.{500 * (k % 2):03d},{500 * (k % 2)},{k % 9},{k % 7}" for k in range(ROWS)]
    content = read("Time,Millitm,FIC1.PV,FIC1.OP\n" + "\n".join(rows))
    assert steps(content.loops["FIC1"]) == [HALF_S]
    assert notes_of(content, "the times are not of whole seconds")


def test_a_short_name_beside_stamps_that_differ_tells_nothing(read: Read) -> None:
    rows = [f"2024-01-31 06:00:{k:02d},{10 + k % 7},{k % 9},{k % 5}" for k in range(ROWS)]
    content = read("Time,ms,FIC1.PV,FIC1.OP\n" + "\n".join(rows))
    assert "ms" in content.loops
    assert notes_of(content, "nothing tells whether it is a part of them or a signal")


def test_a_short_name_elsewhere_is_a_signal(read: Read) -> None:
    rows = [f"2024-01-31 {seconds(k)},{k % 9},{k % 7},{half_seconds(k)}" for k in range(ROWS)]
    content = read("Time,FIC1.PV,FIC1.OP,ms\n" + "\n".join(rows))
    assert "ms" in content.loops
    assert not notes_of(content, "the column 'ms'")


def test_minutes_and_milliseconds_lack_the_seconds(read: Read) -> None:
    rows = [f"2024-01-31 06:{k // 6:02d},{100 * (k % 6)},{k % 9},{k % 7}" for k in range(ROWS)]
    content = read("Time,Millitm,FIC1.PV,FIC1.OP\n" + "\n".join(rows))
    assert notes_of(content, "the times are not of whole seconds")
    assert "Millitm" in content.loops


def test_a_file_of_milliseconds_alone_keeps_them(read: Read) -> None:
    rows = [f"2024-01-31 {seconds(k)},{half_seconds(k)}" for k in range(ROWS)]
    content = read("Time,Milliseconds\n" + "\n".join(rows))
    assert list(content.loops) == ["Milliseconds"]


def test_milliseconds_that_nobody_fills_leave_the_rows_spread(read: Read) -> None:
    for row in ("0", "250"):
        content = read(wide("Time,Millitm,FIC1.PV,FIC1.OP", lambda k, row=row: row))
        assert content.rejects.counts == {}
        assert steps(content.loops["FIC1"]) == [HALF_S]
        assert notes_of(content, "within a second it does not go on as times do")


def test_such_milliseconds_of_a_table_of_tags_lose_no_rows(read: Read) -> None:
    rows = [
        f"01/31/2024;06:{k // 300:02d}:{k // 5 % 60:02d};0;{tag};{k % 9}.5" for k in range(5 * ROWS) for tag in SIGNALS
    ]
    content = read(long(rows))
    assert content.rejects.counts == {}
    assert content.loops["FIC101"].samples == 5 * ROWS


def test_signals_in_a_column_of_words_do_not_hide_their_milliseconds(read: Read) -> None:
    rows = [
        f"L1;{word};2024-01-31 {seconds(k)};{half_seconds(k)};{k % 9}" for k in range(ROWS) for word in ("PV", "OP")
    ]
    content = read("\n".join(("Loop;Signal;Time;Millitm;Value", *rows)))
    assert content.rejects.counts == {}
    assert steps(content.loops["L1"]) == [HALF_S]


def once(k: int) -> str:
    return f"2024-01-31 06:{k // 60:02d}:{k % 60:02d}"


def test_a_name_far_from_the_time_tells_nothing_alone(read: Read) -> None:
    rows = [f"{once(k)},{k % 9},{k % 5},{10 + k % 7}" for k in range(ROWS)]
    content = read("Time,FIC1.PV,FIC1.OP,msec\n" + "\n".join(rows))
    assert steps(content.loops["FIC1"]) == [2 * HALF_S]
    assert content.loops["msec"].samples == ROWS
    assert notes_of(content, "nothing tells whether it is a part of them or a signal")


def test_numbers_that_leap_beside_even_seconds_are_a_signal(read: Read) -> None:
    rows = [f"{once(k)},{k * 577 % 1000},{k % 9},{k % 5}" for k in range(ROWS)]
    content = read("Time,Millis,FIC1.PV,FIC1.OP\n" + "\n".join(rows))
    assert steps(content.loops["FIC1"]) == [2 * HALF_S]
    assert notes_of(content, "nothing tells whether it is a part of them or a signal")


def test_a_phase_that_drifts_beside_even_seconds_is_joined(read: Read) -> None:
    rows = [f"{once(k)},{125 + k},{k % 9},{k % 5}" for k in range(ROWS)]
    content = read("Time,Millitm,FIC1.PV,FIC1.OP\n" + "\n".join(rows))
    assert steps(content.loops["FIC1"]) == [1_001_000_000]


@pytest.mark.parametrize("name", ["ms", "m/s"])
def test_a_speed_that_moves_where_a_second_repeats_is_a_signal(read: Read, name: str) -> None:
    """As the clocks of recorders that run fast repeat one."""
    rows = [f"{once(k - (k >= 30))},{12 + (k >= 30)},{k % 9},{k % 5}" for k in range(ROWS)]
    content = read(f"Time,{name},FIC1.PV,FIC1.OP\n" + "\n".join(rows))
    assert content.loops[name].others[name].tolist()[:2] == [12.0, 12.0]


def test_a_speed_that_rises_slowly_is_a_signal(read: Read) -> None:
    content = read(wide("Time,m/s,FIC1.PV,FIC1.OP", lambda k: str(12 + (k + 1) // 20)))
    assert content.loops["m/s"].samples == ROWS
    assert steps(content.loops["FIC1"]) == [HALF_S]
