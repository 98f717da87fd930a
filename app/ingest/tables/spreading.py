"""Stamps cut to the minute (or second) repeat: the order of the rows is the only clock, and spreads them evenly
inside it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.ingest.model import TimeArray
from app.ingest.tables.wide_chunk import Chunk, joined, part
from app.nanoseconds import NS_PER_S

NANOSECOND = 1
NS_PER_MINUTE = 60 * NS_PER_S
SPREAD_NOTE = "time stamps are cut and repeat: the rows were spread evenly inside each stamp, in their order"


def shown_resolution(time_ns: TimeArray, of_form_ns: int) -> int:
    """To what stamps are cut, a minute, ten seconds or one, by what they show where their writing could show more:
    `:00` stands behind all of them. The one stamp of a sample may be of a minute by chance."""
    several = bool(np.any(time_ns != time_ns[:1]))
    steps = (NS_PER_MINUTE, 10 * NS_PER_S, NS_PER_S) if several else (NS_PER_S,)
    shown = next((step for step in steps if len(time_ns) and not np.any(time_ns % step)), of_form_ns)
    return max(shown, of_form_ns)


def stamps_are_cut(time_ns: TimeArray, resolution_ns: int) -> bool:
    """Whether most stamps of a sample, in order of rows, come several times one after the other, whichever way time
    runs."""
    if resolution_ns <= NANOSECOND or len(time_ns) < 6 or not (is_rising(time_ns) or is_falling(time_ns)):
        return False
    _, counts = np.unique(time_ns, return_counts=True)
    inner = counts[1:-1] if len(counts) > 2 else counts
    return bool(np.median(inner) >= 2 and np.mean(counts >= 2) > 0.8)


def come_in_threes(time_ns: TimeArray) -> bool:
    """Whether a stamp of a tag, in order of rows, comes more than twice. Where all come once or twice, values were sent
    again, corrected, or by two servers."""
    return bool(np.max(_runs(time_ns)[1]) > 2)


class Spreader:
    """Holds back the rows of the last stamp until all of them are there. The first stamp's rows, if it is cut by the
    record's start, end where the next stamp begins; the last one's begin at its stamp; both at the spacing of a whole
    one. Rows may come newest first: what comes last is the record's start then."""

    def __init__(self, resolution_ns: int) -> None:
        self._of_form, self._resolution = resolution_ns, resolution_ns
        self._held: Chunk | None = None
        self._spacing: float | None = None
        self._begun = False
        self._newest_first = False

    def take(self, chunk: Chunk) -> Chunk | None:
        whole = chunk if self._held is None else joined(self._held, chunk)
        n = len(whole.time_ns)
        other = np.flatnonzero(whole.time_ns != whole.time_ns[-1])
        keep = int(other[-1]) + 1 if len(other) else 0
        if keep:
            self._see(shown_resolution(whole.time_ns, self._of_form))
            self._newest_first = is_falling(whole.time_ns)
            keep = keep if self._newest_first or is_rising(whole.time_ns) else n
        self._held = part(whole, slice(keep, None)) if keep < n else None
        return self._spread(part(whole, slice(0, keep))) if keep else None

    def _see(self, resolution_ns: int) -> None:
        """The rows of a minute may all be in the first ones, or a later stamp tell that it is of a second."""
        if not self._begun or resolution_ns < self._resolution:
            self._resolution, self._spacing = resolution_ns, None

    def rest(self) -> Chunk | None:
        """What is held at the file's end."""
        return self._spread(self._held, ending=True) if self._held is not None else None

    def _spread(self, chunk: Chunk, ending: bool = False) -> Chunk:
        first, self._begun = not self._begun, True
        _, counts = _runs(chunk.time_ns)
        if len(counts) > 2 or self._spacing is None:
            self._spacing = self._resolution / float(np.median(counts[1:] if len(counts) > 1 and first else counts))
        way = slice(None, None, -1 if self._newest_first else 1)
        starting, ending = (ending, first) if self._newest_first else (first, ending)
        spread_ns = _spread(chunk.time_ns[way], self._resolution, self._spacing, starting, ending)
        return replace(chunk, time_ns=spread_ns[way])


def spread(time_ns: TimeArray, resolution_ns: int) -> TimeArray:
    """(n,) all times of a tag, in order, each stamp's spread evenly inside of it."""
    _, counts = _runs(time_ns)
    spacing = resolution_ns / float(np.median(counts[1:-1] if len(counts) > 2 else counts))
    return _spread(time_ns, resolution_ns, spacing, starting=True, ending=True)


def _spread(time_ns: TimeArray, resolution_ns: int, spacing: float, starting: bool, ending: bool) -> TimeArray:
    """starting, ending: whether the first and the last stamp may be cut by the record's start and end."""
    starts, counts = _runs(time_ns)
    place = np.arange(len(time_ns)) - np.repeat(starts, counts)
    offset = place * np.repeat(resolution_ns / counts, counts)
    if starting and counts[0] * spacing < resolution_ns:
        first = slice(0, int(counts[0]))
        offset[first] = resolution_ns - (counts[0] - place[first]) * spacing
    if ending and counts[-1] * spacing < resolution_ns:
        offset[starts[-1] :] = place[starts[-1] :] * spacing
    return time_ns + np.floor(offset).astype(np.int64)


def _runs(time_ns: TimeArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where each stamp's rows begin, and how many they are."""
    starts = np.flatnonzero(np.concatenate(([True], np.diff(time_ns) != 0)))
    return starts, np.diff(np.append(starts, len(time_ns)))


def is_rising(time_ns: TimeArray) -> bool:
    return bool(np.all(time_ns[1:] >= time_ns[:-1]))


def is_falling(time_ns: TimeArray) -> bool:
    return bool(np.all(time_ns[1:] <= time_ns[:-1]))
