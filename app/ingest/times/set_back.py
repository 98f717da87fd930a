"""Clocks that were set back by minutes, as one that went ahead: rows of two stretches lie over each other then."""

from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from app.counting import counted
from app.ingest.model import FloatArray, TimeArray
from app.nanoseconds import NS_PER_S

RowNumbers = NDArray[np.intp]

_FEWEST_STEPS, _FEWEST_ROWS = 3, 3
_LONGEST_NS = 1800 * NS_PER_S  # an hour is that of autumn, or of another zone
_MOST_COLUMNS = 64  # that are held of a piece of a file
_MOST = 3  # of the rows of a piece; where more go back, these are of several logs


@dataclass(frozen=True, eq=False)
class Border:
    """The rows of a file next to the piece of it that follows: time_ns (n,), values (n, m) of some columns, oldest
    first. newest_first: rows of the file do not come so, and the following piece is an earlier one."""

    time_ns: TimeArray
    values: FloatArray
    newest_first: bool

    @staticmethod
    def of(time_ns: TimeArray, values: FloatArray, newest_first: bool) -> "Border":
        """Of a piece."""
        some = values[:, :: -(-values.shape[1] // _MOST_COLUMNS)]
        return Border(time_ns, some, newest_first)

    def joined(self, following: "Border") -> "Border":
        """With those of the piece that follows."""
        parts = (following, self) if self.newest_first else (self, following)
        times, values = (np.concatenate(each) for each in zip(*((at.time_ns, at.values) for at in parts), strict=True))
        return Border(times, values, self.newest_first)

    def near(self) -> "Border":
        """As many rows as a clock can be set back by."""
        times = self.time_ns
        if self.newest_first:
            rows = slice(0, int(np.argmax(np.append(times > times[0] + _LONGEST_NS, True))))
        else:
            rows = slice(int(np.argmax(times >= times[-1] - _LONGEST_NS)), len(times))
        return Border(times[rows].copy(), self.values[rows].copy(), self.newest_first)


@dataclass
class SetBack:
    """The steps back that were met: at which time (ns since 1970 UTC) which length (ns)."""

    met: dict[int, int] = field(default_factory=dict)

    def look(self, time_ns: TimeArray, values: FloatArray) -> None:
        """time_ns: (n,) in order of rows, oldest first; values: (n, m). Rows that were sent again say nothing."""
        self._look(time_ns, values, np.flatnonzero(np.diff(time_ns) < 0))

    def look_on(self, before: Border | None, piece: Border) -> Border:
        """The same over the border of a piece of a file with those before it; returns what is next to the following
        one."""
        if before is None or before.newest_first != piece.newest_first:
            return piece.near()
        whole = before.joined(piece)
        back = np.flatnonzero(np.diff(whole.time_ns) < 0)  # once more too where too few rows had come on either side
        if len(back):
            self._look(whole.time_ns, whole.values, back)
        return whole.near()

    def _look(self, time_ns: TimeArray, values: FloatArray, asked: RowNumbers) -> None:
        """asked: the rows behind which time goes back."""
        steps = np.diff(time_ns)
        if not 0 < np.count_nonzero(steps < 0) <= _MOST or not np.any(steps > 0):
            return
        least = _FEWEST_STEPS * int(np.median(steps[steps > 0]))
        for at in asked.tolist():
            if least <= -steps[at] < _LONGEST_NS and _lie_over_each_other(time_ns, values, at):
                self.met[int(time_ns[at])] = int(-steps[at])

    def notes(self, start_ns: int | None = None) -> list[str]:
        """start_ns: where times are counted from a start, as which it was taken: a run may begin there again."""
        if not self.met:
            return []
        at_ns, length_ns = min(self.met.items())
        more = f" (and {counted(len(self.met) - 1, 'time')} more)" if len(self.met) > 1 else ""
        where, why = f"at {_shown(at_ns)} UTC", "where a clock was set back"
        if start_ns is not None:
            where, why = f"{(at_ns - start_ns) / NS_PER_S:g} s after the start", "where another run begins"
        return [
            f"check this first, time goes back by {_said(length_ns)} {where}{more}, as {why}: rows of two stretches "
            "lie over each other there, and of two of a time the later one holds"
        ]


def _lie_over_each_other(time_ns: TimeArray, values: FloatArray, at: int) -> bool:
    """Whether rows behind a step back are of a time that rows before it have too, in one column at least: others fill
    a hole, are of an earlier part of the file, or of another tag. Rows that came already are no such ones."""
    behind = np.flatnonzero(time_ns[at + 1 :] <= time_ns[at]) + at + 1
    earlier, later = time_ns[: at + 1], time_ns[behind]
    if time_ns[at + 1] < earlier.min():  # an earlier export behind a later one
        return False
    before = np.flatnonzero((earlier >= later.min()) & (earlier <= later.max()))
    held = (np.sum(np.isfinite(values[rows]), axis=0) >= _FEWEST_ROWS for rows in (before, behind))
    return bool(np.any(np.logical_and(*held))) and not _came_already(time_ns, values, before, behind)


def _came_already(time_ns: TimeArray, values: FloatArray, before: RowNumbers, behind: RowNumbers) -> bool:
    """Whether most rows have the times of others, and the values but for a few, as the last one of an export has."""
    before = before[np.argsort(time_ns[before], kind="stable")]
    found = before[np.minimum(np.searchsorted(time_ns[before], time_ns[behind]), len(before) - 1)]
    same = time_ns[found] == time_ns[behind]
    earlier, later = values[found[same]], values[behind[same]]
    differ = np.any(np.isfinite(earlier) & np.isfinite(later) & (earlier != later), axis=1)
    return bool(2 * np.count_nonzero(same) > len(behind) and np.count_nonzero(differ) < _FEWEST_ROWS)


def _said(length_ns: int) -> str:
    seconds = length_ns // NS_PER_S
    return counted(round(seconds / 60), "minute") if seconds >= 90 else counted(seconds, "second")


def _shown(at_ns: int) -> str:
    return f"{datetime.fromtimestamp(at_ns // NS_PER_S, UTC):%Y-%m-%d %H:%M:%S}"
