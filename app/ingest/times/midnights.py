"""24:00, the midnight that ends a day, as ISO 8601 has it."""

import numpy as np
import polars as pl

from app.ingest.model import NO_TIME, TimeArray
from app.nanoseconds import NS_PER_S

DAY_NS = 86_400 * NS_PER_S
MIDNIGHT = r"^(\S.*\d[ T])24((?:[:.]00(?:[:.]00(?:[.,]0+)?)?)?(?:Z|[+-]\d{2}:?\d{2})?)$"


def without_begins(texts: pl.Series, time_ns: TimeArray) -> TimeArray:
    """The times (n,), ns, of texts in the order of the rows, but for those of 24:00 that stand between the day before
    theirs and their own: they may begin it, as some loggers count."""
    at = np.flatnonzero((time_ns != NO_TIME) & (time_ns % DAY_NS == 0))
    at = at[(at > 0) & (at < len(time_ns) - 1)]
    at = at[texts[at].str.contains(MIDNIGHT).fill_null(False).to_numpy()] if len(at) else at
    if not len(at):
        return time_ns
    days = [(time_ns[at + step] // DAY_NS) - time_ns[at] // DAY_NS for step in (-1, 1)]
    beside = np.sort(np.stack(days), axis=0)  # 0 is the day that it begins, -1 the one that it ends
    doubtful = (beside[0] == -2) & (beside[1] == -1) & (time_ns[at - 1] != NO_TIME) & (time_ns[at + 1] != NO_TIME)
    time_ns = time_ns.copy()
    time_ns[at[doubtful]] = NO_TIME
    return time_ns
