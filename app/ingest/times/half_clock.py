"""Clocks of twelve hours of which nothing tells the half of the day."""

import numpy as np

from app.ingest.model import TimeArray
from app.nanoseconds import NS_PER_S

HOUR_NS = 3600 * NS_PER_S
NOON, FIRST = 12, 1


class HalfClock:
    """Sees the hours of rows in their order, as far as they are written."""

    def __init__(self) -> None:
        self._possible, self._begins_again = True, False

    def look(self, wall_ns: TimeArray) -> None:
        """wall_ns (n,): times as they are written, some of them perhaps none."""
        if not self._possible:
            return
        known = wall_ns[wall_ns >= 0]
        hours = known // HOUR_NS % 24
        self._possible = not np.any((hours == 0) | (hours > NOON))
        if np.count_nonzero(np.diff(known) < 0) > np.count_nonzero(np.diff(known) > 0):
            known, hours = known[::-1], hours[::-1]  # the newest row stands first
        back = (hours[:-1] == NOON) & (hours[1:] == FIRST) & (known[1:] < known[:-1])
        self._begins_again = self._begins_again or bool(back.any())

    @property
    def lacks_half(self) -> bool:
        """Whether hours go to 12 alone and begin again behind it."""
        return self._possible and self._begins_again
