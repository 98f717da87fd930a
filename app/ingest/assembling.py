"""Blocks of signals gathered into stretches of loops, in bounded memory."""

import pickle
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from app.ingest.align import align
from app.ingest.model import LoopSamples, SignalBlock, TimeArray
from app.ingest.spilling import PARTS

Loops = dict[str, list[SignalBlock]]


class Assembler:
    """Gives each loop once and whole, in bounded memory: what is more than `limit` values is put aside in files."""

    def __init__(self, limit: int, folder: Path | None) -> None:
        self._limit = limit
        self._folder = folder
        self._held = 0
        self._loops: Loops = {}

    def stretches(self, batches: Iterable[list[SignalBlock]], whole_loops: bool) -> Iterator[LoopSamples]:
        """`whole_loops`: no batch brings more of a loop that one before it has brought."""
        with ExitStack() as files:
            aside: Aside | None = None
            for batch in batches:
                for block in batch:
                    self._loops.setdefault(block.loop, []).append(block)
                    self._held += len(block.value)
                if whole_loops:
                    yield from self._flush()
                elif self._held >= self._limit:
                    aside = aside or files.enter_context(Aside(self._folder))
                    aside.add(self._taken())
            if aside is None:
                yield from self._flush()
                return
            aside.add(self._taken())
            for self._loops in aside.parts():
                yield from self._flush()

    def _taken(self) -> Loops:
        loops, self._loops, self._held = self._loops, {}, 0
        return loops

    def _flush(self) -> Iterator[LoopSamples]:
        loops = self._taken()
        times = _JoinedTimes()
        while loops:
            loop = next(iter(loops))
            yield align(times.joined(loops.pop(loop)))


class Aside:
    """Blocks in files without a name, parted by loop; times that signals share are written once a part."""

    def __init__(self, folder: Path | None) -> None:
        self._files = [tempfile.TemporaryFile(dir=folder) for _ in range(PARTS)]  # noqa: SIM115 - closed by __exit__
        self._part_of: dict[str, int] = {}
        self._times = 0

    def add(self, loops: Loops) -> None:
        parts: list[Loops] = [{} for _ in range(PARTS)]
        for loop, blocks in loops.items():
            parts[self._part_of.setdefault(loop, len(self._part_of) % PARTS)][loop] = blocks
        for file, part in zip(self._files, parts, strict=True):
            pickle.dump(part, file, pickle.HIGHEST_PROTOCOL)
        self._times += 1

    def parts(self) -> Iterator[Loops]:
        for file in self._files:
            file.seek(0)
            loops: Loops = {}
            for _ in range(self._times):
                for loop, blocks in pickle.load(file).items():  # noqa: S301 - what `add` wrote; nobody else can open it
                    loops.setdefault(loop, []).extend(blocks)
            file.close()
            yield loops

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for file in self._files:
            file.close()


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
