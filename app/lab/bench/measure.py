"""Clocks and memory: the time of a piece of work, and what processes hold while they work."""

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from app.engine.recording import FloatArray

EVERY_S = 0.25
YARDSTICK_ADDITIONS = 1_000_000


def median_s(work: Callable[[], object], repeats: int = 9) -> float:
    """The median processor time of `work` in s after one call to warm up: other work on the machine disturbs it less
    than it does wall time."""
    return float(np.median(times_s(work, repeats)))


def times_s(work: Callable[[], object], repeats: int) -> FloatArray:
    """(repeats,) processor times of `work` in s after one call to warm up."""
    work()
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        work()
        times.append(time.thread_time() - start)
    return np.array(times)


def yardstick_s() -> float:
    """What a million additions in a loop of Python take just now, in s of processor time: a processor that is shared is
    at times half as fast as at others, and times are to be read beside it.
    """
    total, start = 0, time.thread_time()
    for one in range(YARDSTICK_ADDITIONS):
        total += one
    return time.thread_time() - start


class Stopwatch:
    """Wall time of a block, in s."""

    seconds = 0.0

    def __enter__(self) -> Self:
        self._start = time.perf_counter()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.seconds = time.perf_counter() - self._start


class Memory:
    """Resident memory of processes while a block runs, in MB, sampled a few times a second."""

    def __init__(self, find: Callable[[], Sequence[int]]) -> None:
        self._find = find
        self._seen: dict[int, list[float]] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def _watch(self) -> None:
        while not self._stop.wait(EVERY_S):
            for pid in self._find():
                held = resident_mb(pid)
                if held is not None:
                    self._seen.setdefault(pid, []).append(held)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stop.set()
        self._thread.join()

    @property
    def peak_mb(self) -> float | None:
        return max((max(held) for held in self._seen.values()), default=None)

    @property
    def first_mb(self) -> float | None:
        """What a process held at first, of the one that held most."""
        return max((held[0] for held in self._seen.values()), default=None)

    @property
    def growth(self) -> float | None:
        """The median of the last third of a process's life over that of the second sixth, of the worst process: 1 is
        flat. The first sixth is left out: buffers grow to their size once."""
        ratios = []
        for held in self._seen.values():
            if len(held) >= 24:
                early = held[len(held) // 6 : len(held) // 3]
                ratios.append(float(np.median(held[-len(held) // 3 :]) / np.median(early)))
        return max(ratios, default=None)


def resident_mb(pid: int) -> float | None:
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return None
    return pages * 4096 / 1e6


def children_of(pid: int) -> list[int]:
    """The processes that `pid` started."""
    try:
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def processor_s(pid: int) -> float:
    """Processor time that a process and its ended children have used, in s."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / 100.0
