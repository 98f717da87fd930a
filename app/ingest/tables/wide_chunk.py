"""What a wide table yields piece by piece: one group's samples of a chunk of rows."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from app.ingest.columns.plans import ValueColumn
from app.ingest.model import FloatArray, TimeArray


@dataclass(eq=False)
class Chunk:
    """One group's samples of a chunk of rows: `matrix` (n, columns), the lines they stand in and what each row's time
    is."""

    time_ns: TimeArray
    lines: NDArray[np.int64]
    matrix: FloatArray
    columns: tuple[ValueColumn, ...] = field(default=())


def part(chunk: Chunk, rows: slice) -> Chunk:
    return replace(chunk, time_ns=chunk.time_ns[rows], lines=chunk.lines[rows], matrix=chunk.matrix[rows])


def joined(earlier: Chunk, later: Chunk) -> Chunk:
    return replace(
        later,
        time_ns=np.concatenate((earlier.time_ns, later.time_ns)),
        lines=np.concatenate((earlier.lines, later.lines)),
        matrix=np.concatenate((earlier.matrix, later.matrix)),
    )
