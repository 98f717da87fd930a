"""The hour that comes twice in autumn: by the order of the rows, whichever way they run and wherever a chunk ends."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from app.ingest import NO_TIME, IngestOptions
from app.ingest.times.wall_clock import WallClock

from .conftest import Read

BERLIN = "Europe/Berlin"
HOUR = 3600
BACK = np.datetime64("2026-10-25T01:00:00")  # UTC, when three o'clock became two


def utc(first_s: int, last_s: int, step_s: int = 30) -> np.ndarray:
    """ns since 1970 from some seconds before the clock is set back to some after it."""
    seconds = np.arange(first_s, last_s, step_s)
    return (BACK + seconds.astype("timedelta64[s]")).astype("datetime64[ns]").astype(np.int64)


def shown(times: np.ndarray) -> np.ndarray:
    """What the clock on the wall shows then."""
    back = BACK.astype("datetime64[ns]").astype(np.int64)
    return times + np.where(times < back, 2, 1) * HOUR * 10**9


def read_in_parts(local: np.ndarray, sizes: Sequence[int]) -> np.ndarray:
    clock = WallClock(BERLIN)
    return np.concatenate([clock.to_utc(part) for part in np.split(local, np.cumsum(sizes)) if len(part)])


NIGHT = utc(-2 * HOUR, 3 * HOUR)


@pytest.mark.parametrize(
    "times",
    [
        NIGHT,
        NIGHT[::-1],
        utc(-HOUR + 600, HOUR - 600),
        utc(-HOUR + 600, HOUR - 600)[::-1],
        utc(600, 2 * HOUR),
        utc(-2 * HOUR, -600)[::-1],
        utc(-2 * HOUR, -600),
        utc(-2 * HOUR, 3 * HOUR, 900),
        np.tile(NIGHT, 3),
        np.tile(NIGHT[::-1], 3),
        np.tile(utc(-HOUR, 2 * HOUR), 3),
        np.tile(utc(-HOUR + 600, HOUR - 600), 3),
    ],
)
def test_rows_in_order(times: np.ndarray) -> None:
    np.testing.assert_array_equal(WallClock(BERLIN).to_utc(shown(times)), times)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("step_s", [30, 60, 300])
def test_half_an_hour_comes_twice_on_lord_howe(direction: int, step_s: int) -> None:
    """Rows that come newest first go forward over half an hour, not a whole one."""
    zone, back = ZoneInfo("Australia/Lord_Howe"), datetime(2026, 4, 4, 15, tzinfo=UTC)
    instants = [back + timedelta(seconds=s) for s in range(-2 * HOUR, 2 * HOUR, step_s)][::direction]
    walls = [instant.astimezone(zone).replace(tzinfo=None) for instant in instants]
    local, times = (np.array(those, dtype="datetime64[ns]").astype(np.int64) for those in (walls, as_naive(instants)))
    np.testing.assert_array_equal(WallClock("Australia/Lord_Howe").to_utc(local), times)


def as_naive(instants: Sequence[datetime]) -> list[datetime]:
    return [instant.replace(tzinfo=None) for instant in instants]


@pytest.mark.parametrize("sign", [1, -1])
def test_rows_slightly_out_of_order(sign: int) -> None:
    times = NIGHT[::sign]
    order = np.argsort(np.arange(len(times)) + np.random.default_rng(1).uniform(-4, 4, len(times)))
    np.testing.assert_array_equal(WallClock(BERLIN).to_utc(shown(times[order])), times[order])


@pytest.mark.parametrize("times", [NIGHT, NIGHT[::-1], np.tile(NIGHT, 2)])
@pytest.mark.parametrize("size", [1, 7, 130, 250])
def test_chunks_end_anywhere(times: np.ndarray, size: int) -> None:
    np.testing.assert_array_equal(read_in_parts(shown(times), [size] * (len(times) // size)), times)


def test_rows_without_a_time_are_passed_over() -> None:
    local = shown(NIGHT)
    local[::3] = NO_TIME
    found = WallClock(BERLIN).to_utc(local)
    np.testing.assert_array_equal(found, np.where(local == NO_TIME, NO_TIME, NIGHT))


def test_a_chunk_is_read_again_from_where_it_began() -> None:
    clock, local = WallClock(BERLIN), shown(NIGHT)
    clock.to_utc(local[:300])
    before = clock.before
    once = clock.to_utc(local[300:])
    clock.before = before
    np.testing.assert_array_equal(clock.to_utc(local[300:]), once)
    np.testing.assert_array_equal(once, NIGHT[300:])


def test_times_that_no_clock_showed() -> None:
    spring = np.datetime64("2026-03-29T02:30:00", "ns").astype(np.int64)
    assert WallClock(BERLIN).to_utc(np.array([spring])).tolist() == [NO_TIME]


@pytest.mark.parametrize("newest_first", [False, True])
@pytest.mark.parametrize("layout", ["wide", "long"])
@pytest.mark.parametrize("chunk_bytes", [16 << 20, 1500])
def test_no_value_of_the_night_is_lost(read: Read, layout: str, newest_first: bool, chunk_bytes: int) -> None:
    stamps = [str(time)[:19].replace("T", " ") for time in shown(NIGHT).astype("datetime64[ns]")]
    if layout == "wide":
        head, rows = "Time,A.PV,A.OP\n", [f"{stamp},{i},{i / 2}\n" for i, stamp in enumerate(stamps)]
    else:
        head = "Tagname,TimeStamp,Value\n"
        rows = [f"A.PV,{stamp},{i}\nA.OP,{stamp},{i / 2}\n" for i, stamp in enumerate(stamps)]
    options = IngestOptions(time_zone=BERLIN, chunk_bytes=chunk_bytes)
    loop = read(head + "".join(rows[::-1] if newest_first else rows), options=options).loops["A"]
    np.testing.assert_array_equal(loop.time_ns, NIGHT)
    np.testing.assert_array_equal(loop.pv, np.arange(len(NIGHT)))
