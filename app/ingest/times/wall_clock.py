"""Times of a clock on the wall to UTC, rows in the order in which they come, chunk by chunk."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.model import NO_TIME, TimeArray
from app.nanoseconds import NS_PER_H, NS_PER_S

DISORDER_NS = 600 * NS_PER_S  # rows may be so much out of order; a larger step within the doubled hour is the clock's
FAR_NS = 2 * NS_PER_H  # steps of more than that come from outside of the hour
FIRST, SECOND = 1, 2
OUTSIDE = 0
ABOUT_AN_HOUR_NS = NS_PER_H // 2, 2 * NS_PER_H


@dataclass(frozen=True)
class Before:
    """The row before: its time, and which pass of an hour that comes twice it was; OUTSIDE of one. None: no row."""

    local: int | None = None
    which: int = OUTSIDE


def may_come_twice(first_ns: int, last_ns: int, rows: int, repeats: int) -> bool:
    """Whether those of so many rows that repeat the time of another one are about an hour of them: read in a zone
    without summer time, an hour that a clock showed twice looks so."""
    least, most = ABOUT_AN_HOUR_NS
    return rows > repeats and least <= repeats * (last_ns - first_ns) / (rows - repeats) <= most


class WallClock:
    """Reads times of a zone. `before` is all that it knows of the rows so far: given again, it goes on from there.

    An hour that comes twice in autumn is read by the order of rows. Whoever enters it from earlier times is in its
    first pass, from later ones in its second; a step back within it leads to the second pass (or, from there, to
    another tag's first), one forward over nearly all of it to the first, where rows come newest first. On Lord Howe it
    is half an hour.
    """

    def __init__(self, zone: str) -> None:
        self._zone = zone
        self.before = Before()

    def to_utc(self, local: TimeArray) -> TimeArray:
        """(n,) ns since 1970 UTC; NO_TIME stays, and takes the place of times that no clock showed."""
        if self._zone == "UTC" or not len(local):
            return local
        good = local != NO_TIME
        early, late = self._as_utc(local, good, "earliest"), self._as_utc(local, good, "latest")
        good &= early != NO_TIME
        twice = good & (early != late)
        doubled_ns = int(np.max(late[twice] - early[twice], initial=0))
        chosen = np.where(self._passes(local, good, twice, doubled_ns) == SECOND, late, early)
        return np.where(good, chosen, NO_TIME)

    def _as_utc(self, local: TimeArray, good: NDArray[np.bool_], which: Literal["earliest", "latest"]) -> TimeArray:
        naive = pl.Series(np.where(good, local, 0)).cast(pl.Datetime("ns"))
        zoned = naive.dt.replace_time_zone(self._zone, ambiguous=which, non_existent="null")
        return zoned.dt.convert_time_zone("UTC").cast(pl.Int64).fill_null(NO_TIME).to_numpy()

    def _passes(
        self, local: TimeArray, good: NDArray[np.bool_], twice: NDArray[np.bool_], doubled_ns: int
    ) -> NDArray[np.int8]:
        """(n,) which pass each row is of. doubled_ns: by how much the clock was put back."""
        passes = np.full(len(local), OUTSIDE, dtype=np.int8)
        at = np.flatnonzero(good)
        if np.any(twice):
            passes[at] = self._passes_of(local[at], twice[at], doubled_ns)
        if len(at):
            self.before = Before(int(local[at[-1]]), int(passes[at[-1]]))
        return passes

    def _passes_of(self, local: TimeArray, twice: NDArray[np.bool_], doubled_ns: int) -> NDArray[np.int8]:
        steps = np.diff(local, prepend=local[0] if self.before.local is None else self.before.local)
        was_twice = np.concatenate(([self.before.which != OUTSIDE], twice[:-1]))
        entered = twice & (~was_twice | (np.abs(steps) > FAR_NS))
        stepped = twice & ~entered & ((steps < -DISORDER_NS) | (steps > doubled_ns - DISORDER_NS))
        events = np.flatnonzero(entered | stepped)
        passes = np.where(twice, self.before.which, OUTSIDE).astype(np.int8)
        which = self.before.which
        bounds = np.append(events, len(local))
        for row, end in zip(events.tolist(), bounds[1:].tolist(), strict=True):
            if not entered[row]:
                which = FIRST if steps[row] > 0 or which == SECOND else SECOND
            elif abs(steps[row]) > NS_PER_H or (row == 0 and self.before.local is None):
                next_step = int(steps[end]) if end < len(local) and stepped[end] else 0
                which = _of_beginning(local[row:], twice[row:], next_step)
            else:
                which = FIRST if steps[row] > 0 else SECOND
            passes[row:end] = which
        return np.where(twice, passes, OUTSIDE)


def _of_beginning(local: TimeArray, twice: NDArray[np.bool_], next_step: int) -> int:
    """The pass in which a file or a tag begins, by where its rows lead: a step back is to come, or later times without
    one."""
    if next_step:
        return FIRST if next_step < 0 else SECOND
    outside = np.flatnonzero(~twice)
    return SECOND if len(outside) and local[outside[0]] > local[0] else FIRST
