"""24:00, the midnight that ends a day, as ISO 8601 has it."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.model import NO_TIME, TimeArray
from app.nanoseconds import NS_PER_DAY

MIDNIGHT = r"^(\S.*\d[ T])24((?:[:.]00(?:[:.]00(?:[.,]0+)?)?)?(?:Z|[+-]\d{2}:?\d{2})?)$"


def without_begins(texts: pl.Series, time_ns: TimeArray) -> TimeArray:
    """The times (n,), ns, of texts in the order of the rows, but for those of 24:00 that stand between the day before
    theirs and their own: they may begin it, as some loggers count. Where most do, none is left."""
    at = np.flatnonzero((time_ns != NO_TIME) & (time_ns % NS_PER_DAY == 0))
    at = at[texts[at].str.contains(MIDNIGHT).fill_null(False).to_numpy()] if len(at) else at
    if not len(at):
        return time_ns
    read = np.flatnonzero(time_ns != NO_TIME)
    doubtful = _may_begin(time_ns[read])[np.searchsorted(read, at)]
    time_ns = time_ns.copy()
    time_ns[at if 2 * np.count_nonzero(doubtful) > len(at) else at[doubtful]] = NO_TIME
    return time_ns


def _may_begin(time_ns: TimeArray) -> NDArray[np.bool_]:
    """(n,) whether a time, read as the end of a day, stands between the day before that and the day itself. Rows of
    one time stand together."""
    starts = np.flatnonzero(np.concatenate(([True], time_ns[1:] != time_ns[:-1])))
    each = time_ns[starts]
    days = each // NS_PER_DAY
    beside = np.sort(np.stack((days[:-2] - days[1:-1], days[2:] - days[1:-1])), axis=0)
    may = np.zeros(len(each), dtype=bool)
    may[1:-1] = (beside[0] == -2) & (beside[1] == -1)  # -1 is the day that it ends
    return np.repeat(may, np.diff(starts, append=len(time_ns)))
