"""Clocks that were set back by minutes are told as that."""

from collections.abc import Callable
from datetime import datetime, timedelta

import pytest

from app.ingest import IngestOptions

from .conftest import Content, Read

START = datetime(2026, 5, 14, 6)
Table = Callable[[list[datetime]], str]
TOLD = "check this first, time goes back by"


def stamps(back_s: float, rows: int = 200, at: int = 100) -> list[datetime]:
    """A sample every 10 s, the clock set back behind row `at`."""
    return [START + timedelta(seconds=10 * i - (back_s if i >= at else 0)) for i in range(rows)]


def wide(times: list[datetime]) -> str:
    rows = (f"{time},{50 + i % 7}.{i % 10},{40 + i % 5}.5\n" for i, time in enumerate(times))
    return "Time,A.PV,A.OP\n" + "".join(rows)


def long(times: list[datetime]) -> str:
    rows = (f"A.{tag},{time},{50 + i % 7}.{i % 10}\n" for tag in ("PV", "OP") for i, time in enumerate(times))
    return "Tag,Time,Value\n" + "".join(rows)


def told(content: Content) -> list[str]:
    return [note for note in content.summary.notes if note.startswith(TOLD)]


@pytest.mark.parametrize("table", [wide, long])
@pytest.mark.parametrize(("back_s", "said"), [(310, "5 minutes"), (313, "5 minutes"), (70, "60 seconds")])
def test_a_clock_that_was_set_back_is_told(read: Read, table: Table, back_s: float, said: str) -> None:
    (note,) = told(read(table(stamps(back_s))))
    assert note.startswith(f"{TOLD} {said} at 2026-05-14 06:16:30 UTC, as where a clock was set back")


@pytest.mark.parametrize("table", [wide, long])
@pytest.mark.parametrize("back_s", [0, 20, 3610])
def test_rows_that_run_on_or_jitter_and_an_hour_are_no_such_clock(read: Read, table: Table, back_s: float) -> None:
    assert told(read(table(stamps(back_s)))) == []


def test_a_clock_set_back_is_told_of_rows_that_come_newest_first(read: Read) -> None:
    head, *rows = wide(stamps(310)).splitlines()
    assert len(told(read("\n".join((head, *reversed(rows)))))) == 1


def test_rows_that_were_sent_again_are_no_such_clock(read: Read) -> None:
    head, *rows = wide(stamps(0)).splitlines()
    content = read("\n".join((head, *rows[:100], *rows[70:])))
    assert told(content) == []
    assert "30 rows have the time of a row before" in " ".join(content.summary.notes)


def test_rows_of_two_logs_are_no_such_clock(read: Read) -> None:
    head, *rows = wide(stamps(0)).splitlines()
    blocks = [row for at in range(0, 200, 20) for row in (*rows[at + 10 : at + 20], *rows[at : at + 10])]
    assert told(read("\n".join((head, *blocks)))) == []


def of_time(times: list[datetime]) -> list[str]:
    """Rows whose values their times tell."""
    return [
        f"{time},{50 + k % 7}.{k % 10},{40 + k % 5}.5"
        for time in times
        for k in [(time - START) // timedelta(seconds=10)]
    ]


def spans(*ends: tuple[int, int]) -> list[datetime]:
    return [START + timedelta(seconds=10 * k) for first, last in ends for k in range(first, last)]


@pytest.mark.parametrize(
    "times",
    [
        spans((120, 180), (60, 120), (0, 60)),
        spans((60, 120), (0, 60)),
        spans((0, 50), (90, 150), (50, 90), (150, 200)),
        [time + timedelta(seconds=3 * (100 <= i < 140)) for i, time in enumerate(spans((0, 50), (90, 150), (50, 90)))],
    ],
)
@pytest.mark.parametrize("layout", ["wide", "long"])
def test_pages_newest_first_and_holes_that_are_filled_later_are_no_such_clock(
    read: Read, times: list[datetime], layout: str
) -> None:
    """Rows that were held back where a line was down come behind later ones, and lie over none."""
    rows = of_time(times)
    if layout == "wide":
        content = read("Time,A.PV,A.OP\n" + "\n".join(rows))
    else:
        fields = [row.split(",") for row in rows]
        tags = (f"A.{tag},{row[0]},{row[at]}" for at, tag in ((1, "PV"), (2, "OP")) for row in fields)
        content = read("Tag,Time,Value\n" + "\n".join(tags))
    assert told(content) == []


def test_tags_one_behind_the_other_in_columns_of_their_own_are_no_such_clock(read: Read) -> None:
    rows = [f"{START + timedelta(seconds=10 * i)},{50 + i % 7}.5," for i in range(120)]
    rows += [f"{START + timedelta(seconds=10 * i + 3)},,{40 + i % 5}.5" for i in range(120)]
    assert told(read("Time,A.PV,A.OP\n" + "\n".join(rows))) == []


def test_an_earlier_export_behind_a_later_one_that_it_overlaps_is_no_such_clock(read: Read) -> None:
    rows = of_time(spans((95, 180), (0, 100)))
    rows[-5:] = [row.rpartition(",")[0] + ",99.9" for row in rows[-5:]]
    assert told(read("Time,A.PV,A.OP\n" + "\n".join(rows))) == []


def test_an_export_whose_last_value_was_not_final_is_no_such_clock(read: Read) -> None:
    rows = of_time(spans((0, 100), (60, 200)))
    rows[99] = rows[99].rpartition(",")[0] + ",99.9"
    assert told(read("Time,A.PV,A.OP\n" + "\n".join(rows))) == []


@pytest.mark.parametrize("back_s", [300, 303])
def test_a_clock_that_was_set_back_twice(read: Read, back_s: int) -> None:
    seconds = (10 * i - back_s * ((i >= 100) + (i >= 250)) for i in range(400))
    (note,) = told(read(wide([START + timedelta(seconds=one) for one in seconds])))
    assert "(and 1 time more)" in note


def test_seconds_that_begin_again_are_those_of_another_run(read: Read) -> None:
    rows = (f"{10 * i},{50 + i % 7}.{(i + run) % 10},{40 + i % 5}.5\n" for run in (0, 1) for i in range(60))
    (note,) = told(read("Time [s],A.PV,A.OP\n" + "".join(rows)))
    assert note.startswith(f"{TOLD} 10 minutes 590 s after the start, as where another run begins: rows of two")


@pytest.mark.parametrize("newest_first", [False, True])
@pytest.mark.parametrize("at", range(80, 121, 5))
def test_a_clock_set_back_where_two_pieces_of_a_file_meet(read: Read, at: int, newest_first: bool) -> None:
    """All rows are as long as the others: a piece has twenty of them."""
    head, *rows = wide(stamps(310, at=at)).splitlines(keepends=True)
    rows = rows[::-1] if newest_first else rows
    content = read("".join((head, *rows)), options=IngestOptions(chunk_bytes=20 * len(rows[0])))
    (note,) = told(content)
    assert note.startswith(f"{TOLD} 5 minutes at ")


@pytest.mark.parametrize("times", [spans((0, 100), (60, 200)), spans((60, 120), (0, 60)), spans((0, 100), (100, 200))])
def test_pieces_that_meet_where_no_clock_was_set_back(read: Read, times: list[datetime]) -> None:
    rows = of_time(times)
    options = IngestOptions(chunk_bytes=20 * (len(rows[0]) + 1))
    assert told(read("\n".join(("Time,A.PV,A.OP", *rows)), options=options)) == []
