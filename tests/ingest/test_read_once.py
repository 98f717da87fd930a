"""What is said of stamps that come twice in autumn, where a file has them once."""

from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest

from app.ingest import IngestOptions

from .conftest import Read

TURN = datetime(2025, 10, 26, 1, tzinfo=UTC)
NOTE = (
    "stamps from 02:00 to 03:00 on 2025-10-26 come twice in Europe/Berlin: those here were read as the {} ones, which "
    "their rows do not tell for sure"
)


def minutes(*spans: tuple[int, int]) -> list[int]:
    """From the turn on."""
    return [minute for first, end in spans for minute in range(first, end)]


A_SHORT_STEP_BACK = minutes((-60, -20), (10, 60))  # which is hardly one forward from the newest row on


def stamps(of: Iterable[int], zone: str, turn: datetime = TURN) -> list[str]:
    clock = ZoneInfo(zone)
    return [f"{(turn + timedelta(minutes=minute)).astimezone(clock):%Y-%m-%d %H:%M:%S}" for minute in of]


def wide(at: list[str]) -> str:
    return "Time,A.PV,A.OP\n" + "".join(f"{stamp},{i % 7}.5,{i % 5}.5\n" for i, stamp in enumerate(at))


def long(at: list[str]) -> str:
    rows = (f"A.{s},{stamp},{i % 7}.5\n" for i, stamp in enumerate(at) for s in ("PV", "OP"))
    return "Tag,Time,Value\n" + "".join(rows)


def twice(read: Read, text: str, zone: str, chunk_bytes: int) -> list[str]:
    options = IngestOptions(time_zone=zone, chunk_bytes=chunk_bytes)
    return [note for note in read(text, options=options).summary.notes if "come twice" in note]


@pytest.mark.parametrize("layout", [wide, long])
@pytest.mark.parametrize("chunk_bytes", [16 << 20, 700])
@pytest.mark.parametrize(
    ("of", "which"),
    [
        (minutes((-60, -30)), "first"),
        (minutes((0, 30)), "first"),
        (minutes((-120, -20), (-5, 0)), "first"),
        (minutes((-180, 0), (60, 120)), "first"),
        (minutes((-180, 0), (60, 62), (63, 120)), "first"),
    ],
    ids=[
        "first pass alone",
        "second pass alone",
        "a hole in it",
        "no second pass",
        "a short hole",
    ],
)
def test_a_pass_that_the_rows_do_not_tell_is_told(read: Read, layout, of: list[int], which: str, chunk_bytes) -> None:
    at = stamps(of, "Europe/Berlin")
    assert twice(read, layout(at), "Europe/Berlin", chunk_bytes) == [NOTE.format(which)]
    assert twice(read, layout(at), "UTC", chunk_bytes) == []


@pytest.mark.parametrize("layout", [wide, long])
@pytest.mark.parametrize(
    "of",
    [
        minutes((-180, 180)),
        minutes((-90, -30)),
        minutes((30, 120)),
        A_SHORT_STEP_BACK,
        minutes((-180, -60), (60, 180)),
        list(range(-600, 600, 60)),
        list(range(-600, 600, 5)),
    ],
    ids=["both", "into the first", "out of the second", "a step back", "neither", "hourly", "five minutes"],
)
def test_nothing_is_said_where_the_rows_tell(read: Read, layout, of: list[int]) -> None:
    at = stamps(of, "Europe/Berlin")
    assert twice(read, layout(at), "Europe/Berlin", 16 << 20) == []
    if of != A_SHORT_STEP_BACK:
        assert twice(read, layout(at[::-1]), "Europe/Berlin", 16 << 20) == []


@pytest.mark.parametrize("layout", [wide, long])
def test_a_hole_over_the_turn(read: Read, layout) -> None:
    at = stamps(minutes((-60, -10), (55, 120)), "Europe/Berlin")
    assert twice(read, layout(at), "Europe/Berlin", 16 << 20) == [NOTE.format("second")]


def test_half_an_hour_that_comes_twice(read: Read) -> None:
    turn = datetime(2026, 4, 4, 15, tzinfo=UTC)
    at = stamps(minutes((-30, -10)), "Australia/Lord_Howe", turn)
    (note,) = twice(read, wide(at), "Australia/Lord_Howe", 16 << 20)
    assert note.startswith("stamps from 01:30 to 02:00 on 2026-04-05 come twice in Australia/Lord_Howe: ")
    assert twice(read, wide(stamps(minutes((-90, 90)), "Australia/Lord_Howe", turn)), "Australia/Lord_Howe", 99) == []


def test_tags_one_below_the_other_that_are_read_as_different_passes(read: Read) -> None:
    at = stamps(minutes((0, 30)), "Europe/Berlin")
    text = "Tag,Time,Value\n" + "".join(f"A.{s},{stamp},{i}.5\n" for s in ("PV", "OP") for i, stamp in enumerate(at))
    (note,) = twice(read, text, "Europe/Berlin", 16 << 20)
    assert "read as the first ones of some tags and the second ones of others" in note
