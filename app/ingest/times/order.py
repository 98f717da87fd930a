"""Order of time: sorting what came backward, and one value for a time that came twice."""

from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.model import FloatArray, TimeArray
from app.ingest.rejecting import RejectLog

SHUFFLED = 0.1  # of the steps


def in_order(time_ns: TimeArray) -> NDArray[np.int64] | None:
    """The rows in order of time, rows of one time as they came; None where they are in order already."""
    if len(time_ns) < 2 or bool(np.all(time_ns[1:] >= time_ns[:-1])):
        return None
    return np.argsort(time_ns, kind="stable")


def runs_back(time_ns: TimeArray) -> bool:
    """Whether rows come newest first: those of one stamp do so too. Of shuffled rows half of the steps go back."""
    steps = np.diff(time_ns)
    return bool(np.count_nonzero(steps < 0) > 2 * np.count_nonzero(steps > 0))


def are_shuffled(time_ns: TimeArray) -> bool:
    """Whether so many steps go back that the rows of a piece are not those of a stretch of time."""
    return bool(np.count_nonzero(time_ns[1:] < time_ns[:-1]) > SHUFFLED * len(time_ns))


def without_stutter(time_ns: TimeArray, matrix: FloatArray) -> TimeArray:
    """A stamp that comes twice where the next one is two steps away was rounded the wrong way: its second row belongs
    to the step that is missing. Times must be in order, and are not where rows that came twice are moved.

    Where most that repeat have no step missing behind them, rows came twice, and some of these before a hole of one
    step: stamps were rounded there only if some are so without the rows that are like an earlier one of their stamp.
    """
    moved, mostly = _without_slips(time_ns)
    if mostly:
        return moved
    first, like = _rows_once(time_ns, matrix)
    once, mostly = _without_slips(time_ns[first])
    if not mostly or not np.any(once != time_ns[first]):
        return time_ns
    moved[-1] = time_ns[-1]  # nothing behind it tells
    return np.maximum(moved, once[like])


def _without_slips(time_ns: TimeArray) -> tuple[TimeArray, bool]:
    """Times without the stamps that were rounded the wrong way, and whether no more of those that repeat are others."""
    steps = np.diff(time_ns)
    if len(time_ns) < 4 or not np.any(steps):
        return time_ns, True
    usual = int(np.median(steps[steps > 0]))
    slipped = (steps[:-1] == 0) & (np.abs(steps[1:] - 2 * usual) <= usual // 2)
    if not np.any(slipped):
        return time_ns, True
    moved = time_ns.copy()
    moved[-1] += usual if steps[-1] == 0 else 0  # after the others, the end of the record too
    moved[np.flatnonzero(slipped) + 1] += usual
    return moved, bool(2 * np.count_nonzero(slipped) >= np.count_nonzero(steps == 0))


def _rows_once(time_ns: TimeArray, matrix: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The rows without those that are like an earlier one in stamp and values, and which of them each row is like."""
    columns = [pl.Series(f"{position}", values) for position, values in enumerate(matrix.T)]
    frame = pl.DataFrame([pl.Series("time", time_ns), *columns])
    earliest = frame.with_row_index("row").select(pl.col("row").min().over(frame.columns)).to_series().to_numpy()
    first, like = np.unique(earliest.astype(np.int64), return_inverse=True)
    return first, like


def last_of_repeats(
    time_ns: TimeArray, matrix: FloatArray, lines: NDArray[np.integer[Any]], tags: list[str], log: RejectLog
) -> tuple[TimeArray, FloatArray]:
    """One row a time: of the values given for it the last stands, and where an earlier one differed that one is
    counted."""
    repeated = np.concatenate((time_ns[1:] == time_ns[:-1], [False])) if len(time_ns) else np.zeros(0, dtype=bool)
    if not np.any(repeated):
        return time_ns, matrix
    at, last = np.flatnonzero(repeated), np.flatnonzero(~repeated)
    merged = matrix[last]
    for position, tag in enumerate(tags):
        earlier, later = matrix[at, position], matrix[at + 1, position]
        differs = np.isfinite(earlier) & np.isfinite(later) & (earlier != later)
        if np.any(differs):
            pairs = zip(earlier[differs], later[differs], strict=True)
            texts = (f"{first:g} and then {second:g} for the same time; the later stands" for first, second in pairs)
            log.add_many("duplicate_time", lines[at[differs]].tolist(), texts, tag)
        if np.any(np.isnan(later)):
            merged[:, position] = _last_known(matrix[:, position], last)
    return time_ns[last], merged


def _last_known(values: FloatArray, last: NDArray[np.intp]) -> FloatArray:
    """The last value of each run of rows that is one; the last NaN where none is. last: of each run, the last row."""
    first = np.concatenate(([0], last[:-1] + 1))
    known = np.maximum.reduceat(np.where(np.isnan(values), -1, np.arange(len(values))), first)
    return values[np.where(known < 0, last, known)]
