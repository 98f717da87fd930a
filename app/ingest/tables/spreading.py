"""Stamps cut to the minute (or second) repeat: the order of the rows is the only clock, and spreads them evenly
inside it."""

from dataclasses import replace

import numpy as np

from app.ingest.model import TimeArray
from app.ingest.tables.wide_chunk import Chunk, joined, part

NANOSECOND = 1


def stamps_are_cut(time_ns: TimeArray, resolution_ns: int) -> bool:
    """Whether most stamps of a sample, in order of rows, come several times one after the other."""
    if resolution_ns <= NANOSECOND or len(time_ns) < 6 or np.any(np.diff(time_ns) < 0):
        return False
    _, counts = np.unique(time_ns, return_counts=True)
    inner = counts[1:-1] if len(counts) > 2 else counts
    return bool(np.median(inner) >= 2 and np.mean(counts >= 2) > 0.8)


class Spreader:
    """Holds back the rows of the last stamp until all of them are there. The first stamp's rows, if it is cut by the
    file's start, end where the next stamp begins; the last one's begin at its stamp; both at the spacing of a whole
    one."""

    def __init__(self, resolution_ns: int) -> None:
        self._resolution = resolution_ns
        self._held: Chunk | None = None
        self._spacing: float | None = None
        self._started = False

    def take(self, chunk: Chunk) -> Chunk | None:
        whole = chunk if self._held is None else joined(self._held, chunk)
        keep = int(np.searchsorted(whole.time_ns, whole.time_ns[-1])) if _rising(whole.time_ns) else len(whole.time_ns)
        self._held = part(whole, slice(keep, None)) if keep < len(whole.time_ns) else None
        return self._spread(part(whole, slice(0, keep))) if keep else None

    def rest(self) -> Chunk | None:
        """What is held at the file's end."""
        return self._spread(self._held, ending=True) if self._held is not None else None

    def _spread(self, chunk: Chunk, ending: bool = False) -> Chunk:
        starts = np.flatnonzero(np.concatenate(([True], np.diff(chunk.time_ns) != 0)))
        counts = np.diff(np.append(starts, len(chunk.time_ns)))
        if len(counts) > 2 or self._spacing is None:
            usual = float(np.median(counts[1:] if len(counts) > 1 and not self._started else counts))
            self._spacing = self._resolution / usual
        place = np.arange(len(chunk.time_ns)) - np.repeat(starts, counts)
        spacing = np.repeat(self._resolution / counts, counts)
        offset = place * spacing
        if not self._started and counts[0] * self._spacing < self._resolution:
            first = slice(0, int(counts[0]))
            offset[first] = self._resolution - (counts[0] - place[first]) * self._spacing
        if ending and counts[-1] * self._spacing < self._resolution:
            offset[starts[-1] :] = place[starts[-1] :] * self._spacing
        self._started = True
        return replace(chunk, time_ns=chunk.time_ns + np.floor(offset).astype(np.int64))


def _rising(time_ns: TimeArray) -> bool:
    return bool(np.all(time_ns[1:] >= time_ns[:-1]))
