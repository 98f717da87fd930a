"""A moment is the same moment in every way that it is told."""

from datetime import UTC, datetime, timedelta, timezone

import pytest

from app.services.moments import epoch_ms, iso_utc

MOMENTS = [
    datetime(2026, 11, 21, 12, 0, 29, 865_700, tzinfo=UTC),
    datetime(2026, 11, 21, 12, 0, 29, 999_999, tzinfo=UTC),
    datetime(2026, 11, 21, 12, 0, 29, tzinfo=UTC),
    datetime(2026, 11, 21, 14, 0, 29, 500, tzinfo=timezone(timedelta(hours=2))),
    datetime(1969, 12, 31, 23, 59, 59, 999_400, tzinfo=UTC),
]


@pytest.mark.parametrize("moment", MOMENTS)
def test_milliseconds_are_those_of_the_written_time(moment):
    written = datetime.fromisoformat(iso_utc(moment) or "")
    assert epoch_ms(moment) == round(written.timestamp() * 1000)
    assert timedelta(0) <= moment - written < timedelta(milliseconds=1)
