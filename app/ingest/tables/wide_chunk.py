"""What a wide table yields piece by piece: one group's samples of a chunk of rows, with whole stamps at its end."""

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


class WholeStamps:
    """Holds back each chunk until the next one is there, which gets the last rows where these are of one stamp, or of
    its first: rows of a stamp are told from those that came twice by what comes behind them."""

    def __init__(self) -> None:
        self._held: Chunk | None = None

    def take(self, chunk: Chunk) -> Chunk | None:
        held, self._held = self._held, chunk
        if held is None:
            return None
        last = held.time_ns[-1]
        of_last = int(np.argmax((held.time_ns != last)[::-1]))  # 0 where all are: they stay
        if not of_last or (of_last == 1 and chunk.time_ns[0] != last):
            return held
        cut = len(held.time_ns) - of_last
        self._held = joined(part(held, slice(cut, None)), chunk)
        return part(held, slice(0, cut))

    def rest(self) -> Chunk | None:
        """What is held at the file's end."""
        return self._held
