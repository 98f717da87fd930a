"""Pieces of a table parted by loop in files, so that every loop comes whole, however the file is ordered. A part that
is too large for memory is parted once more, down to single loops: memory grows with the largest of them, not with the
file."""

import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from app.ingest.tables.pieces import Gathered, Grid, Piece

PARTS = 64
TYPES = (np.dtype(np.uint32), np.dtype(np.int64), np.dtype(np.float64), np.dtype(np.uint32))
ROW_BYTES = sum(kind.itemsize for kind in TYPES)
VALUE_BYTES = 8
VALUES_A_ROW = ROW_BYTES // VALUE_BYTES  # that a row takes the room of


class NoRoomToPartError(OSError):
    """The disk is full, or a quota used up. parted_bytes: what of the file had been put there before."""

    def __init__(self, error: OSError, parted_bytes: int) -> None:
        super().__init__(error.errno, error.strerror)
        self.parted_bytes = parted_bytes


class NumberOfLoop:
    """The number of each loop, in turn as they come."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def of(self, loop: str) -> int:
        return self._numbers.setdefault(loop, len(self._numbers))


class Spill:
    """Files without a name, which are gone with this process however it ends. most_values: what a part may hold if it
    has several loops. level: how often its pieces were parted before."""

    def __init__(self, folder: Path | None, most_values: int, level: int = 0) -> None:
        self._folder, self._most_values, self._level = folder, most_values, level
        self._files: dict[int, IO[bytes]] = {}
        self._held: dict[int, list[int | Grid]] = {}  # rows of a piece, or a grid without its values
        self._loop_of_code: NDArray[np.uint32] = np.zeros(0, dtype=np.uint32)
        self._shares: list[tuple[int, NDArray[np.intp], Grid]] = []
        self._shared_by: Grid | None = None
        self._written = 0

    def add(self, piece: Piece, loop_of_code: NDArray[np.uint32]) -> None:
        """What a piece holds of each part, in the order in which it came. Raises NoRoomToPartError."""
        self._loop_of_code = loop_of_code
        part_of_code = loop_of_code // PARTS**self._level % PARTS
        if isinstance(piece, Grid):
            self._add_grid(piece, part_of_code)
        else:
            self._add_rows(piece, part_of_code)

    def parts(self) -> Iterator[list[Piece]]:
        """The pieces of each part once; its file is gone afterwards. Raises NoRoomToPartError where one that is parted
        again does not fit beside itself."""
        for part in sorted(self._files):
            file, each = self._files[part], self._held.pop(part)
            file.seek(0)
            if sum(map(_values, each)) > self._most_values and self._may_be_parted():
                yield from self._parted_again(file, each)
            else:
                yield [_read(file, held) for held in each]
            file.close()

    def _may_be_parted(self) -> bool:
        return int(self._loop_of_code.max()) >= PARTS ** (self._level + 1)

    def _parted_again(self, file: IO[bytes], each: list[int | Grid]) -> Iterator[list[Piece]]:
        again = Spill(self._folder, self._most_values, self._level + 1)
        again._written = self._written
        try:
            for held in each:
                again.add(_read(file, held), self._loop_of_code)
            file.close()
            yield from again.parts()
        finally:
            again.close()

    def close(self) -> None:
        for file in self._files.values():
            with suppress(OSError):  # what no longer fits is not needed any more
                file.close()

    def _write(self, file: IO[bytes], values: NDArray[Any]) -> None:
        try:
            file.write(np.ascontiguousarray(values).data)
        except OSError as error:
            raise NoRoomToPartError(error, self._written) from error
        self._written += values.nbytes

    def _add_rows(self, rows: Gathered, part_of_code: NDArray[np.uint32]) -> None:
        parts = part_of_code[rows.codes]
        sorted_rows = rows.at(np.argsort(parts, kind="stable"))
        ends = np.cumsum(np.bincount(parts, minlength=PARTS))
        start = 0
        for part, end in enumerate(ends.tolist()):
            if end > start:
                file = self._file(part, end - start)
                own = sorted_rows.at(slice(start, end))
                for column in (own.codes, own.time_ns, own.values, own.lines):
                    self._write(file, column)
            start = end

    def _add_grid(self, grid: Grid, part_of_code: NDArray[np.uint32]) -> None:
        for part, at, own in self._shares_of(grid, part_of_code):
            held = Grid(own.codes, grid.time_ns, np.empty((len(at), 0)), grid.lines, own.places)
            self._write(self._file(part, held), grid.values[at])

    def _shares_of(self, grid: Grid, part_of_code: NDArray[np.uint32]) -> list[tuple[int, NDArray[np.intp], Grid]]:
        """Each part's tags of a grid. Most grids of a file have the same tags, and share these arrays."""
        known = self._shared_by
        if known is None or not np.array_equal(known.codes, grid.codes):
            parts = part_of_code[grid.codes]
            self._shares = [(int(part), *_share(grid, np.flatnonzero(parts == part))) for part in np.unique(parts)]
            self._shared_by = Grid(grid.codes, grid.time_ns[:0], grid.values[:, :0], grid.lines[:0], grid.places)
        return self._shares

    def _file(self, part: int, held: int | Grid) -> IO[bytes]:
        if part not in self._files:
            self._files[part] = tempfile.TemporaryFile(dir=self._folder)  # noqa: SIM115 - closed by parts() or close()
        self._held.setdefault(part, []).append(held)
        return self._files[part]


def _share(grid: Grid, at: NDArray[np.intp]) -> tuple[NDArray[np.intp], Grid]:
    return at, Grid(grid.codes[at], grid.time_ns[:0], np.empty((len(at), 0)), grid.lines[:0], grid.places[at])


def _values(held: int | Grid) -> int:
    """That the memory for a piece has room for."""
    return len(held.codes) * len(held.time_ns) if isinstance(held, Grid) else held * VALUES_A_ROW


def _read(file: IO[bytes], held: int | Grid) -> Piece:
    if isinstance(held, Grid):
        shape = (len(held.codes), len(held.time_ns))
        raw = file.read(VALUE_BYTES * shape[0] * shape[1])
        values = np.frombuffer(raw, np.float64).reshape(shape)
        return Grid(held.codes, held.time_ns, values, held.lines, held.places)
    raw = file.read(held * ROW_BYTES)
    columns: list[Any] = []
    start = 0
    for kind in TYPES:
        columns.append(np.frombuffer(raw, kind, held, start))
        start += held * kind.itemsize
    return Gathered(*columns)
