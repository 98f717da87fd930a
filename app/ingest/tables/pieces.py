"""Pieces of a table on their way to whole loops: rows as they came, or grids of tags that were sampled together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.ingest.model import FloatArray, TimeArray

Codes = NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class Gathered:
    """Values of some rows: which tag (a code), when, what, in which line."""

    codes: Codes
    time_ns: TimeArray
    values: FloatArray
    lines: NDArray[np.uint32]

    def __len__(self) -> int:
        return len(self.codes)

    def at(self, where: NDArray[np.intp] | slice) -> "Gathered":
        return Gathered(self.codes[where], self.time_ns[where], self.values[where], self.lines[where])


@dataclass(frozen=True, eq=False)
class Grid:
    """Values of `codes` (m,) at `time_ns` (k,), all tags at each instant: `values` is (m, k). Tag i of instant j stands
    in line `lines[j] + places[i]`."""

    codes: Codes
    time_ns: TimeArray
    values: FloatArray
    lines: NDArray[np.uint32]
    places: NDArray[np.uint32]

    def __len__(self) -> int:
        return self.values.size

    def rows(self) -> Gathered:
        """Instant by instant, as they came."""
        m, k = self.values.shape
        lines = self.lines[:, None] + self.places
        return Gathered(np.tile(self.codes, k), np.repeat(self.time_ns, m), self.values.T.ravel(), lines.ravel())


Piece = Gathered | Grid


def joined(parts: Sequence[Gathered]) -> Gathered:
    if len(parts) == 1:
        return parts[0]
    columns = zip(*((part.codes, part.time_ns, part.values, part.lines) for part in parts), strict=True)
    return Gathered(*map(np.concatenate, columns))


def joined_grid(pieces: Sequence[Piece]) -> Grid | None:
    """The pieces as one grid, if they are grids of the same tags and time runs forward through all of them."""
    grids = [piece for piece in pieces if isinstance(piece, Grid)]
    if not grids or len(grids) < len(pieces) or any(not _same(grid.codes, grids[0].codes) for grid in grids):
        return None
    time_ns = np.concatenate([grid.time_ns for grid in grids])
    if not np.all(time_ns[1:] > time_ns[:-1]):
        return None
    values = grids[0].values if len(grids) == 1 else np.concatenate([grid.values for grid in grids], axis=1)
    lines = np.concatenate([grid.lines for grid in grids])
    return Grid(grids[0].codes, time_ns, values, lines, grids[0].places)


def in_whole_instants(rows: Gathered) -> tuple[Gathered, Gathered]:
    """The rows parted where the last of their instants begins, which may go on in the next rows; a single instant is
    taken for whole."""
    begins = int(np.argmax((rows.time_ns != rows.time_ns[-1])[::-1]))
    cut = len(rows) - begins if begins else len(rows)
    return rows.at(slice(0, cut)), rows.at(slice(cut, None))


def as_piece(rows: Gathered) -> Piece:
    """Rows as a grid where they are one: the same tags in the same order at each instant, in lines without a gap.

    Historians write whole scans so; a grid needs no sorting and a third of the space."""
    n = len(rows)
    m = int(np.argmax(rows.time_ns != rows.time_ns[0]))
    if m < 2 or n % m or int(rows.lines[-1]) - int(rows.lines[0]) != n - 1:
        return rows
    codes, instants = rows.codes[:m], rows.time_ns[::m].copy()
    shape = (n // m, m)
    regular = np.array_equal(rows.codes.reshape(shape), np.broadcast_to(codes, shape))
    if not regular or np.any(rows.time_ns.reshape(shape) != instants[:, None]) or np.bincount(codes).max() > 1:
        return rows
    places = np.arange(m, dtype=np.uint32)
    return Grid(codes.copy(), instants, rows.values.reshape(shape).T, rows.lines[::m].copy(), places)


def _same(first: Codes, second: Codes) -> bool:
    return first is second or np.array_equal(first, second)
