"""Clocks of twelve hours of which nothing tells the half of the day."""

import numpy as np

from app.ingest.model import TimeArray
from app.nanoseconds import NS_PER_H

NOON, FIRST = 12, 1


class HalfClock:
    """Sees the hours of rows in their order, as far as they are written. by_tag: rows are of several tags, and may be
    sorted by them: what goes on is seen tag by tag."""

    def __init__(self, by_tag: bool = False) -> None:
        self._by_tag = by_tag
        self._looked, self._possible, self._begins_again = False, True, False

    def look(self, wall_ns: TimeArray) -> None:
        """wall_ns (n,): times as they are written, some of them perhaps none."""
        if not self._possible:
            return
        hours = _hours(wall_ns[wall_ns >= 0])
        self._looked, self._possible = True, not np.any((hours == 0) | (hours > NOON))
        if not self._by_tag:
            self.look_on(wall_ns)

    def look_on(self, wall_ns: TimeArray) -> None:
        """The same of rows that go on from each other."""
        if not (self._looked and self._possible):
            return
        known = wall_ns[wall_ns >= 0]
        if np.count_nonzero(np.diff(known) < 0) > np.count_nonzero(np.diff(known) > 0):
            known = known[::-1]  # the newest row stands first
        hours = _hours(known)
        back = (hours[:-1] == NOON) & (hours[1:] == FIRST) & (known[1:] < known[:-1])
        self._begins_again = self._begins_again or bool(back.any())

    @property
    def lacks_half(self) -> bool:
        """Whether hours go to 12 alone and begin again behind it."""
        return self._possible and self._begins_again


def _hours(wall_ns: TimeArray) -> TimeArray:
    return wall_ns // NS_PER_H % 24
