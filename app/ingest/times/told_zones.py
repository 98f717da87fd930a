"""The zone of a column's times by its name, as in `UTC Time`, `Timestamp_UTC`, `Time (UTC+01:00)` or
`Time (Europe/Berlin)`."""

import re
from zoneinfo import available_timezones

from app.ingest.remembering import remembered
from app.ingest.times.spelled_times import ZONES_IN_LETTERS
from app.nanoseconds import NS_PER_S

_UTC = re.compile(r"(?i)(?:(?<![a-z])(?:utc|gmt)|(?:utc|gmt)(?![a-z]))(?:\s*([+-])\s*(\d{1,2})(?::?(\d{2}))?)?")

_PLACE = re.compile(r"[\[(]\s*([A-Z][A-Za-z]+/[A-Z]\w+(?:/\w+)?)\s*[\])]")
_LETTERS = re.compile(rf"[\[(]\s*({'|'.join(ZONES_IN_LETTERS)})\s*[\])]")


def told_zone(name: str) -> str:
    """The IANA name of the zone of the clock that the times show; empty where the name of their column tells none."""
    found = _PLACE.search(name)
    return found[1] if found and found[1] in available_timezones() else ""


def zone_in_letters(name: str) -> str:
    """As in `Time (CET)`. Behind a stamp it tells the offset of it; of a column it leaves open whether its clock
    was put forward in summer."""
    found = _LETTERS.search(name)
    return found[1] if found else ""


@remembered(1 << 17)
def told_utc_offset_ns(name: str) -> int | None:
    """Of the clock that the times show, from UTC; None where the name tells none."""
    found = _UTC.search(name)
    if found is None:
        return None
    sign, hours, minutes = found.groups()
    offset_ns = (int(hours or 0) * 60 + int(minutes or 0)) * 60 * NS_PER_S
    return -offset_ns if sign == "-" else offset_ns


@remembered(1 << 17)
def without_zone(name: str) -> str:
    return _UTC.sub(" ", name)
