"""Hourly samples over the hour that comes twice in autumn: two rows of one stamp, which no step back tells apart."""

from collections.abc import Collection
from datetime import UTC, datetime

import numpy as np

from app.ingest.model import TimeArray
from app.ingest.times.time_reader import from_utc
from app.nanoseconds import NS_PER_H, NS_PER_S

_MONTHS = (3, 4, 9, 10, 11)
_SATURDAY, _SUNDAY = 5, 6
_NIGHT = frozenset(((_SATURDAY, 23), (_SUNDAY, 0), (_SUNDAY, 1), (_SUNDAY, 2), (_SUNDAY, 3)))
"""Months, and hours of the week, in which clocks are put back."""


def are_put_back(times_ns: Collection[int], zone: str) -> bool:
    """Whether times (ns since 1970 UTC) that came twice, one after the other, are hours at which clocks are put back
    somewhere: in the night to a Sunday in spring or autumn, whatever the zone of these is."""
    local = from_utc(np.array(sorted(times_ns), dtype=np.int64), zone)
    return bool(times_ns) and all(map(_is_of_a_turn, local.tolist()))


def _is_of_a_turn(local_ns: int) -> bool:
    at = datetime.fromtimestamp(local_ns // NS_PER_S, UTC)
    return local_ns % NS_PER_H == 0 and at.month in _MONTHS and (at.weekday(), at.hour) in _NIGHT


def hours_apart(time_ns: TimeArray, zone: str) -> TimeArray:
    """(n,) ns since 1970 UTC, in order. Of two rows in one pass of a doubled hour, with nothing in the other pass, each
    gets its own, in the order in which they came."""
    same = np.flatnonzero(time_ns[1:] == time_ns[:-1]) if zone != "UTC" else np.zeros(0, dtype=np.int64)
    if not len(same) or np.median(np.diff(np.unique(time_ns))) != NS_PER_H:
        return time_ns
    at = time_ns[same]
    local = from_utc(at, zone)
    first, second = from_utc(at + NS_PER_H, zone) == local, from_utc(at - NS_PER_H, zone) == local
    padded = np.concatenate(([at[0] - 2 * NS_PER_H], time_ns, [at[-1] + 2 * NS_PER_H]))
    before, after = at - padded[same], padded[same + 3] - at  # both are 0 where a stamp comes three times
    early = np.where(first & (after >= 2 * NS_PER_H) & (before > 0), at, at - NS_PER_H)
    told = (early == at) | (second & (before >= 2 * NS_PER_H) & (after > 0))
    moved = time_ns.copy()
    moved[same[told]] = early[told]
    moved[same[told] + 1] = early[told] + NS_PER_H
    return moved
