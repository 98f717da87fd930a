"""Columns of times by their names."""

from collections.abc import Collection, Mapping
from typing import NamedTuple

from app.ingest.columns.plain_names import plain, words_in
from app.ingest.remembering import remembered
from app.ingest.times.told_units import told_unit
from app.ingest.times.told_zones import told_utc_offset_ns, without_zone

TIME_NAMES = frozenset(
    (
        *("time", "datetime", "date", "timestamp", "dateandtime", "tstamp", "ts", "zeit"),
        *("datum", "zeitstempel", "t", "localtime", "timeutc", "utc", "utctime", "sampletime"),
        *("datatime", "times", "datetimes", "seconds", "timesec", "timeseconds", "sourcetime", "sourcetimestamp"),
        *("servertime", "servertimestamp", "eventtime", "timestring", "iptrendtime", "horodatage"),
    )
)
SHORT_TIME_NAMES = frozenset(("t", "ts"))
"""Names of times where no other is: a temperature and a sampling interval are called so too."""


def time_columns(names: tuple[str, ...]) -> tuple[int, ...]:
    """The column named as a time; date and time apart are two. Those of UTC go before those of another clock."""
    told = {index: found for index, name in words_in(names).items() if (found := _of_time(name)) is not None}
    bare = {
        index: plain(without_zone(names[index])) or found.plain
        for index, found in told.items()
        if found.utc_offset_ns is not None
    }
    in_utc = {index: name for index, name in bare.items() if told[index].utc_offset_ns == 0}
    if named := _named_as_times(in_utc) or _named_as_times(bare):
        return named
    known = {index: found.plain for index, found in told.items()}
    return _named_as_times(known, {index for index in told if told[index].has_unit and not _is_time(known[index])})


class _OfTime(NamedTuple):
    """What a name tells of times: its plain form, the offset of a clock, and whether it is one with a unit."""

    plain: str
    utc_offset_ns: int | None
    has_unit: bool


@remembered(1 << 17)
def _of_time(name: str) -> _OfTime | None:
    """None, as of nearly all names, where it tells nothing of them: a plant has names by the 10,000."""
    found = _OfTime(plain(name), told_utc_offset_ns(name), is_time_with_unit(name))
    return found if _is_time(found.plain) or found.utc_offset_ns is not None or found.has_unit else None


def _named_as_times(names: Mapping[int, str], with_unit: Collection[int] = ()) -> tuple[int, ...]:
    """By their plain names, or with a unit behind a name where no other is one in full: date and clock have none."""
    of = {name: index for index, name in reversed(list(names.items()))}
    if "date" in of and "time" in of:
        return of["date"], of["time"]
    times = sorted(
        (name in SHORT_TIME_NAMES, index in with_unit, index)
        for index, name in names.items()
        if _is_time(name) or index in with_unit
    )
    return (times[0][2],) if times else ()


def is_time_with_unit(name: str) -> bool:
    return unit_of_times(name) is not None


def unit_of_times(name: str) -> float | None:
    """In s, as `time_ms` has one; but T_h is a temperature."""
    told = told_unit(name)
    return told.seconds if told is not None and plain(told.bare) in TIME_NAMES - SHORT_TIME_NAMES else None


def _is_time(name: str) -> bool:
    return name in TIME_NAMES or name.startswith("timestamp")


def is_full_time(name: str) -> bool:
    found = _of_time(name)
    return found is not None and (found.has_unit or (_is_time(found.plain) and found.plain not in SHORT_TIME_NAMES))
