"""A moment is the same moment in every way that it is told."""

from datetime import UTC, datetime, timedelta, timezone

import pytest

from app.services.moments import FARTHEST_NS, PlantClock, epoch_ms, iso_utc, moment_of, ns_of

MOMENTS = [
    datetime(2026, 11, 21, 12, 0, 29, 865_700, tzinfo=UTC),
    datetime(2026, 11, 21, 12, 0, 29, 999_999, tzinfo=UTC),
    datetime(2026, 11, 21, 12, 0, 29, tzinfo=UTC),
    datetime(2026, 11, 21, 14, 0, 29, 500, tzinfo=timezone(timedelta(hours=2))),
    datetime(1969, 12, 31, 23, 59, 59, 999_400, tzinfo=UTC),
]
NANOSECONDS = [
    1_795_262_429_865_700_000,
    1_795_262_429_999_999_000,
    1_795_262_429_000_000_000,
    1_795_262_429_000_500_000,
    -600_000,
]


@pytest.mark.parametrize("moment", MOMENTS)
def test_milliseconds_are_those_of_the_written_time(moment):
    written = datetime.fromisoformat(iso_utc(moment) or "")
    assert epoch_ms(moment) == round(written.timestamp() * 1000)
    assert timedelta(0) <= moment - written < timedelta(milliseconds=1)


@pytest.mark.parametrize(("moment", "ns"), list(zip(MOMENTS, NANOSECONDS, strict=True)))
def test_nanoseconds_are_exact(moment, ns):
    assert ns_of(moment) == ns
    assert moment_of(ns) == moment


def test_beyond_the_times_of_samples_nanoseconds_are_their_ends():
    last = datetime(9999, 12, 31, tzinfo=timezone(timedelta(hours=-12)))
    assert (ns_of(datetime.min), ns_of(last)) == (-FARTHEST_NS, FARTHEST_NS)
    assert ns_of(datetime(1970, 1, 2)) == 86_400 * 10**9


@pytest.mark.parametrize(
    ("zone", "told"),
    [
        ("UTC", "2026-01-31 23:30 UTC"),
        ("Europe/Berlin", "2026-02-01 00:30 UTC+01:00"),
        ("Asia/Manila", "2026-02-01 07:30 UTC+08:00"),
        ("Asia/Dubai", "2026-02-01 03:30 UTC+04:00"),
        ("Asia/Kolkata", "2026-02-01 05:00 UTC+05:30"),
        ("America/Sao_Paulo", "2026-01-31 20:30 UTC-03:00"),
    ],
)
def test_people_are_told_what_a_clock_of_the_plant_shows(zone, told):
    clock = PlantClock(zone)
    assert clock.told("2026-01-31T23:30:00Z") == told
    assert clock.short("2026-01-31T23:30:00.865Z") == told[:16]
    assert clock.date(datetime(2026, 1, 31, 23, 30, tzinfo=UTC)) == told[:10]
    assert clock.short(None) == "–"


@pytest.mark.parametrize("zone", ["UTC", "Europe/Berlin", "America/New_York"])
def test_what_counts_from_a_start_that_nobody_told_is_in_no_zone(zone):
    clock = PlantClock(zone)
    assert clock.short("1970-01-01T00:00:00Z") == "1970-01-01 00:00"
    assert clock.told("1970-01-01T00:27:00Z") == "1970-01-01 00:27 UTC"
    assert clock.span("1970-01-03T05:58:00Z", "1970-01-03T08:45:00Z") == "1970-01-03 05:58 to 08:45"


def test_an_hour_that_comes_twice_is_told_apart_and_read_as_the_first():
    clock = PlantClock("Europe/Berlin")
    assert clock.told("2026-10-25T00:30:00Z") == "2026-10-25 02:30 UTC+02:00"
    assert clock.told("2026-10-25T01:30:00Z") == "2026-10-25 02:30 UTC+01:00"
    assert iso_utc(clock.instant(datetime(2026, 10, 25, 2, 30))) == "2026-10-25T00:30:00Z"
    assert iso_utc(clock.instant(datetime(2026, 7, 1, 12))) == "2026-07-01T10:00:00Z"
    assert iso_utc(clock.instant(datetime(2026, 7, 1, 12, tzinfo=UTC))) == "2026-07-01T12:00:00Z"


@pytest.mark.parametrize("zone", ["Asia/Manila", "America/New_York"])
def test_the_ends_of_the_calendar_are_told_as_they_are_and_not_read(zone):
    clock = PlantClock(zone)
    assert clock.short("0001-01-01T00:00:00Z").startswith("0001-01-01")
    assert clock.short("9999-12-31T23:59:00Z").startswith("9999-12-31")


def test_what_no_calendar_has_is_no_instant():
    with pytest.raises(OverflowError):
        PlantClock("America/New_York").instant(datetime(9999, 12, 31, 23, 59))


def test_a_day_that_nobody_told_is_no_date() -> None:
    clock = PlantClock("Europe/Berlin")
    assert clock.day("2026-01-31T23:30:00Z") == "2026-02-01"
    assert clock.day("1970-01-01T00:49:55Z") == "no date"
    assert clock.day(None) == ""


def test_the_time_of_a_sample_that_nobody_told_is_no_date() -> None:
    clock = PlantClock("Europe/Berlin")
    assert clock.recorded("2026-01-31T23:30:00Z") == "2026-02-01 00:30"
    assert clock.recorded("1970-01-01T00:49:55Z") == "no date"
    assert clock.recorded(None) == ""
