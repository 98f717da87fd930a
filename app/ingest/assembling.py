"""Blocks of signals gathered into stretches of loops, in bounded memory."""

from collections.abc import Iterable, Iterator

import numpy as np

from app.ingest.align import align
from app.ingest.model import LoopSamples, SignalBlock, TimeArray


class Assembler:
    """Holds blocks by loop until there are `limit` values, then gives every loop's stretch and starts anew.

    A file below the limit gives each loop once. Above it a loop of a wide file comes in several stretches, and at their
    seams a signal may be missing that the next stretch brings: stretches are to be put together with `merge`.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._held = 0
        self._loops: dict[str, list[SignalBlock]] = {}

    def stretches(self, batches: Iterable[list[SignalBlock]], whole_loops: bool) -> Iterator[LoopSamples]:
        """`whole_loops`: no batch brings more of a loop that one before it has brought."""
        for batch in batches:
            for block in batch:
                self._loops.setdefault(block.loop, []).append(block)
                self._held += len(block.value)
            if whole_loops or self._held >= self._limit:
                yield from self._flush()
        yield from self._flush()

    def _flush(self) -> Iterator[LoopSamples]:
        loops, self._loops, self._held = self._loops, {}, 0
        times = _JoinedTimes()
        while loops:
            loop = next(iter(loops))
            yield align(times.joined(loops.pop(loop)))


class _JoinedTimes:
    """Joins the chunks of each signal; signals of a wide file share their arrays of times, which are joined once for
    all of them."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, ...], tuple[list[TimeArray], TimeArray | None]] = {}

    def joined(self, blocks: list[SignalBlock]) -> list[SignalBlock]:
        by_tag: dict[str, list[SignalBlock]] = {}
        for block in blocks:
            by_tag.setdefault(block.tag, []).append(block)
        return [block for parts in by_tag.values() for block in self._one(parts)]

    def _one(self, parts: list[SignalBlock]) -> list[SignalBlock]:
        if len(parts) == 1:
            return parts
        times = [part.time_ns for part in parts]
        key = tuple(map(id, times))
        if key not in self._known:
            whole = np.concatenate(times)
            rising = bool(np.all(whole[1:] > whole[:-1]))
            self._known[key] = (times, whole if rising else None)
        together = self._known[key][1]
        if together is None:
            return parts
        first = parts[0]
        return [
            SignalBlock(first.tag, first.loop, first.signal, together, np.concatenate([part.value for part in parts]))
        ]
