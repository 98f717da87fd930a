"""Rows of a long table parted by loop in files, so that every loop comes whole, however the file is ordered, and memory
does not grow with the file."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from app.ingest.model import FloatArray, TimeArray

PARTS = 64  # of 60 million rows a part is a million: quickly sorted, soon forgotten
TYPES = (np.dtype(np.uint32), np.dtype(np.int64), np.dtype(np.float64), np.dtype(np.uint32))
ROW_BYTES = sum(kind.itemsize for kind in TYPES)


@dataclass(frozen=True, eq=False)
class Gathered:
    """Values of some rows: which tag (a code), when, what, in which line."""

    codes: NDArray[np.uint32]
    time_ns: TimeArray
    values: FloatArray
    lines: NDArray[np.uint32]

    def __len__(self) -> int:
        return len(self.codes)

    def at(self, where: NDArray[np.intp]) -> "Gathered":
        return Gathered(self.codes[where], self.time_ns[where], self.values[where], self.lines[where])


def joined(parts: list[Gathered]) -> Gathered:
    if len(parts) == 1:
        return parts[0]
    columns = zip(*((part.codes, part.time_ns, part.values, part.lines) for part in parts), strict=True)
    return Gathered(*map(np.concatenate, columns))


class Spill:
    """Files without a name, which are gone with this process however it ends."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._files: dict[int, IO[bytes]] = {}
        self._counts: dict[int, list[int]] = {}

    def add(self, rows: Gathered, part_of_code: NDArray[np.uint8]) -> None:
        """Rows keep their order in each part."""
        parts = part_of_code[rows.codes]
        sorted_rows = rows.at(np.argsort(parts, kind="stable"))
        ends = np.cumsum(np.bincount(parts, minlength=PARTS))
        start = 0
        for part, end in enumerate(ends.tolist()):
            if end > start:
                self._write(part, sorted_rows, slice(start, end))
            start = end

    def parts(self) -> Iterator[Gathered]:
        """Each part once; its file is gone afterwards."""
        for part in sorted(self._files):
            file = self._files[part]
            file.seek(0)
            yield joined([_read(file, count) for count in self._counts[part]])
            file.close()

    def close(self) -> None:
        for file in self._files.values():
            file.close()

    def _write(self, part: int, rows: Gathered, where: slice) -> None:
        if part not in self._files:
            self._files[part] = tempfile.TemporaryFile(dir=self._folder)  # noqa: SIM115 - closed by parts() or close()
            self._counts[part] = []
        self._counts[part].append(where.stop - where.start)
        for column in (rows.codes, rows.time_ns, rows.values, rows.lines):
            self._files[part].write(np.ascontiguousarray(column[where]).data)


def _read(file: IO[bytes], count: int) -> Gathered:
    raw = file.read(count * ROW_BYTES)
    columns, start = [], 0
    for kind in TYPES:
        columns.append(np.frombuffer(raw, kind, count, start))
        start += count * kind.itemsize
    return Gathered(*columns)
