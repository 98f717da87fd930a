"""Rows whose time their tags had already are counted and told, whether they say the same or not."""

import re
from collections.abc import Callable

import numpy as np
import pytest

from app.ingest import IngestOptions
from app.ingest.rejecting import RejectLog
from app.ingest.times.order import last_of_repeats
from tests.ingest.conftest import Read

TOLD = "rows have the time of a row before; of each tag the last value of a time was taken"


def test_rows_that_are_all_the_same_are_told(read: Read) -> None:
    content = read("time,PV,OP\n" + "2026-01-31 00:00:00,1,2\n" * 1000)
    assert (content.summary.rows_kept, content.loops["export"].samples, content.rejects.total) == (1000, 1, 0)
    assert f"999 {TOLD}" in content.summary.notes


def test_rows_that_repeat_with_other_values_are_refused_and_told(read: Read) -> None:
    minutes = [f"2026-01-31 00:{k:02d}:00" for k in range(30)]
    rows = [f"{minute},{k},5\n" for k, minute in enumerate(minutes)]
    rows[20:20] = [f"{minutes[3]},70,5\n", f"{minutes[7]},70,5\n", f"{minutes[7]},80,5\n"]
    wide = read("time,PV,OP\n" + "".join(rows))
    long = read("tag,time,value\n" + "".join(f"F1.PV,{row.rsplit(',', 1)[0]}\n" for row in rows))
    for content in (wide, long):
        assert dict(content.rejects.counts) == {"duplicate_time": 3}
        assert f"3 {TOLD}" in content.summary.notes


def put_back(tag: str | None = None) -> str:
    """From half past midnight on by a clock that goes from 3 h back to 2 h, a sample every 15 s."""
    seconds = [1800 + 15 * k - (3600 if k >= 600 else 0) for k in range(900)]
    stamps = [f"2026-10-25 {at // 3600:02d}:{at // 60 % 60:02d}:{at % 60:02d}" for at in seconds]
    if tag is None:
        return "time,PV,OP\n" + "".join(f"{stamp},{k % 50},{k % 40}\n" for k, stamp in enumerate(stamps))
    return "tag,time,value\n" + "".join(f"{tag},{stamp},{k % 50}\n" for k, stamp in enumerate(stamps))


@pytest.mark.parametrize("text", [put_back(), put_back("F1.PV")], ids=["wide", "long"])
def test_an_hour_that_came_twice_asks_for_the_zone_of_the_times(read: Read, text: str) -> None:
    """In UTC, the usual zone, an hour of the night was lost without a word of why."""
    told = [note for note in read(text).summary.notes if "twice in autumn" in note]
    assert told == [
        "an hour of rows came twice: if it is the one that a clock shows twice in autumn, name the zone of the times "
        "(they were read as those of UTC), and both hours are kept"
    ]
    there = read(text, options=IngestOptions(time_zone="Europe/Berlin")).summary
    assert not any("twice" in note for note in there.notes)
    in_file = read(re.sub(r"(:\d\d),", r"\1Z,", text)).summary
    assert (in_file.time_zone, any("twice" in note for note in in_file.notes)) == ("in the file", False)


@pytest.mark.parametrize(("zone", "told"), [("Asia/Tokyo", True), ("Europe/Berlin", False)])
def test_who_named_a_zone_that_puts_its_clocks_back_is_not_asked_for_one(read: Read, zone: str, told: bool) -> None:
    """Two pieces of a day in June overlapped, and the note promised both hours to whoever names the zone."""
    seconds = [1800 + 15 * k - (3600 if k >= 600 else 0) for k in range(900)]
    stamps = [f"2026-06-10 {at // 3600:02d}:{at // 60 % 60:02d}:{at % 60:02d}" for at in seconds]
    text = "time,PV,OP\n" + "".join(f"{stamp},{k % 50},{k % 40}\n" for k, stamp in enumerate(stamps))
    notes = read(text, options=IngestOptions(time_zone=zone)).summary.notes
    assert any(TOLD in note for note in notes)
    assert any("twice in autumn" in note for note in notes) is told


def test_a_file_without_repeats_tells_of_none(read: Read) -> None:
    content = read("time,PV,OP\n" + "".join(f"2026-01-31 00:{k:02d}:00,1,2\n" for k in range(30)))
    assert content.summary.notes == ()


def test_of_each_tag_the_last_value_of_a_time_is_kept() -> None:
    nan = np.nan
    matrix = np.array([[1, nan, 1], [nan, nan, 2], [nan, 5, nan], [2, 6, 3], [nan, 7, nan], [nan, nan, nan]])
    time_ns = np.array([0, 0, 0, 10, 10, 20])
    log = RejectLog(9)
    once, merged = last_of_repeats(time_ns, matrix, np.arange(6), ["A", "B", "C"], log)
    assert once.tolist() == [0, 10, 20]
    np.testing.assert_array_equal(merged, [[1, 5, 2], [2, 7, 3], [nan, nan, nan]])
    assert [(reject.tag, reject.line) for reject in log.result().listed] == [("C", 0), ("B", 3)]


def rows_of(stamps_s: list[int]) -> list[str]:
    return [f"{second},{np.sin(0.3 * k):.6f},{k % 37}\n" for k, second in enumerate(stamps_s)]


WITH_HOLES = rows_of([10 * k for k in range(300) if k % 40 != 7])
SLIPPED = rows_of([10 * (k - (k % 30 == 17)) for k in range(300)])


@pytest.mark.parametrize("rows", [WITH_HOLES, SLIPPED])
@pytest.mark.parametrize(
    "written",
    [
        lambda rows: [*rows, *rows],
        lambda rows: [*rows[:200], *rows[100:]],
        lambda rows: [row for k, row in enumerate(rows) for _ in range(1 + (k % 5 == 3))],
        lambda rows: rows[::-1],
    ],
    ids=["all twice", "two files that overlap", "some twice", "newest first"],
)
def test_rows_before_a_missing_step_are_the_same_however_often_they_come(
    read: Read, rows: list[str], written: Callable[[list[str]], list[str]]
) -> None:
    plain, again = (read("time,PV,OP\n" + "".join(each)).loops["export"] for each in (rows, written(rows)))
    assert again.time_ns.tolist() == plain.time_ns.tolist()
    assert again.pv.tolist() == plain.pv.tolist()
    assert again.op.tolist() == plain.op.tolist()


@pytest.mark.parametrize("way", [1, -1])
def test_of_two_values_of_a_time_the_later_one_holds_whichever_way_the_rows_run(read: Read, way: int) -> None:
    minutes = [f"2026-01-31 00:{k:02d}:00" for k in range(30)]
    rows = [(minute, k) for k, minute in enumerate(minutes)]
    rows.insert(8, (minutes[7], 70))
    wide = read("time,F1.PV,F1.OP\n" + "".join(f"{minute},{value},1\n" for minute, value in rows[::way]))
    long = read("tag,time,value\n" + "".join(f"F1.PV,{minute},{value}\n" for minute, value in rows[::way]))
    for content in (wide, long):
        assert content.loops["F1"].pv.tolist() == [70 if k == 7 else k for k in range(30)]
        assert dict(content.rejects.counts) == {"duplicate_time": 1}


@pytest.mark.parametrize("seed", range(6))
def test_of_shuffled_rows_the_later_value_of_a_time_holds(read: Read, seed: int) -> None:
    """Half of their steps go back: whether that made a file newest first was chance."""
    rows = [(k, float(k)) for k in range(30)] + [(7, 70.5)]
    np.random.default_rng(seed).shuffle(rows)
    content = read("time,F1.PV,F1.OP\n" + "".join(f"2026-01-31 00:{k:02d}:00,{value},1\n" for k, value in rows))
    assert content.loops["F1"].pv[7] == [value for k, value in rows if k == 7][-1]


@pytest.mark.parametrize("chunk_bytes", [311, 619, 1000])
@pytest.mark.parametrize("way", [1, -1])
def test_of_two_values_of_a_time_at_the_end_of_a_chunk_the_later_one_holds_too(
    read: Read, way: int, chunk_bytes: int
) -> None:
    minutes = [f"2026-01-31 {k // 60:02d}:{k % 60:02d}:00" for k in range(300)]
    rows = [f"{minute},{k + part},1\n" for k, minute in enumerate(minutes) for part in ([0.25, 0.5][k % 3 != 1 :])]
    content = read("time,F1.PV,F1.OP\n" + "".join(rows[::way]), options=IngestOptions(chunk_bytes=chunk_bytes))
    assert content.loops["F1"].pv.tolist() == [k + 0.5 for k in range(300)]
