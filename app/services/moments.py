"""Times as people and machines take them."""

from datetime import UTC, datetime, timedelta

EPOCH = datetime.fromtimestamp(0, UTC)


def epoch_ms(moment: datetime | None) -> int | None:
    """Whole milliseconds since 1970, UTC, those that `iso_utc` tells: what dashboards take for a time."""
    return None if moment is None else (moment - EPOCH) // timedelta(milliseconds=1)


def iso_utc(moment: datetime | None) -> str | None:
    """2026-01-31T03:00:00Z, with milliseconds only where there are any; what is below them is cut."""
    if moment is None:
        return None
    if moment.tzinfo is None:
        raise ValueError("a time without a zone cannot be told in UTC")
    utc = moment.astimezone(UTC).replace(tzinfo=None)
    return utc.isoformat(timespec="milliseconds" if utc.microsecond else "seconds") + "Z"


def short_time(iso: str | None) -> str:
    """2026-01-31T03:00:00Z as 2026-01-31 03:00."""
    return (iso or "–")[:16].replace("T", " ")


def moment_of(time_ns: int) -> datetime:
    return datetime.fromtimestamp(time_ns / 1e9, UTC)


def ns_of(moment: datetime) -> int:
    """Nanoseconds since 1970, UTC."""
    return (moment - EPOCH) // timedelta(microseconds=1) * 1000
