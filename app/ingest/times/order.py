"""Order of time: sorting what came backward, and one value for a time that came twice."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.ingest.model import FloatArray, TimeArray
from app.ingest.rejecting import RejectLog


def in_order(time_ns: TimeArray) -> NDArray[np.int64] | None:
    """The rows in order of time, rows of one time as they came; None where they are in order already."""
    if len(time_ns) < 2 or bool(np.all(time_ns[1:] >= time_ns[:-1])):
        return None
    return np.argsort(time_ns, kind="stable")


def without_stutter(time_ns: TimeArray) -> TimeArray:
    """A stamp that comes twice where the next one is two steps away was rounded the wrong way: its second row belongs
    to the step that is missing. Times must be in order."""
    if len(time_ns) < 4:
        return time_ns
    steps = np.diff(time_ns)
    if not np.any(steps):
        return time_ns
    usual = int(np.median(steps[steps > 0]))
    slipped = (steps[:-1] == 0) & (np.abs(steps[1:] - 2 * usual) <= usual // 2)
    if not np.any(slipped):
        return time_ns
    moved = time_ns.copy()
    moved[-1] += usual if steps[-1] == 0 else 0  # after the others, the end of the record too
    moved[np.flatnonzero(slipped) + 1] += usual
    return moved


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
