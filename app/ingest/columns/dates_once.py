"""Dates beside clocks that stand in the first row of a day alone, as merged cells are exported."""

from collections.abc import Callable

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.columns.joined_stamps import stamps_of
from app.ingest.columns.plans import name_of
from app.ingest.model import NO_TIME, TimeArray


class DatesOnce:
    """Reads the times of rows, chunk by chunk in their order; a clock without a date has the one of the row above, as
    long as clocks go on: one that runs back may be of the next day."""

    def __init__(self, time: tuple[int, ...]) -> None:
        self._time = time
        self._date = ""  # the last one that stood in a row
        self._before_ns = NO_TIME  # of the last row with a time
        self._turned = False  # clocks ran back since the last date
        self.carried = 0  # rows that have the date of one above

    def read(self, frame: pl.DataFrame, read: Callable[[pl.Series], TimeArray]) -> tuple[pl.Series, TimeArray]:
        """What stands in the rows for their times, and the times: (n,) ns, NO_TIME where a row has none."""
        texts = stamps_of(frame, self._time)
        if len(self._time) == 1 or not frame.height:
            return texts, read(texts)
        date, clock = (frame[name_of(at)] for at in (self._time[0], self._time[-1]))
        without = (date.is_null() & clock.is_not_null()).to_numpy()
        if without.any():
            date = date.cast(pl.String).fill_null(strategy="forward").fill_null(self._date)
            whole = frame.with_columns(date.alias(name_of(self._time[0])))
            time_ns = self._going_on(read(stamps_of(whole, self._time)), without)
        else:
            time_ns = read(texts)
        self._see(date, time_ns, without)
        return texts, time_ns

    def _going_on(self, time_ns: TimeArray, without: NDArray[np.bool_]) -> TimeArray:
        """Without the times whose clocks ran back since the last date, or on where the others run back."""
        timed = np.flatnonzero(time_ns != NO_TIME)
        carried = without[timed]
        before_ns = self._before_ns if self._before_ns != NO_TIME else time_ns[timed[:1]]
        steps = np.diff(time_ns[timed], prepend=before_ns)
        turns = carried & (steps < 0 if np.sum(steps > 0) >= np.sum(steps < 0) else steps > 0)
        turns[:1] |= self._turned & carried[:1]
        at = np.arange(1, len(timed) + 1)
        turned = np.maximum.accumulate(at * turns) > np.maximum.accumulate(at * ~carried)
        self._turned = bool(len(turned) and turned[-1])
        time_ns = time_ns.copy()
        time_ns[timed[turned]] = NO_TIME
        return time_ns

    def _see(self, date: pl.Series, time_ns: TimeArray, without: NDArray[np.bool_]) -> None:
        known = date.drop_nulls().tail(1).cast(pl.String)
        self._date = known[0] if len(known) else self._date
        timed = time_ns != NO_TIME
        self.carried += int(np.count_nonzero(without & timed))
        if timed.any():
            self._before_ns = int(time_ns[np.flatnonzero(timed)[-1]])
            self._turned = self._turned and bool(without.any())
