"""How many fields lines have. Polars does not count them where it parts some columns alone: what stands behind a field
too many, or behind one that was lost, would be taken for another column's."""

import re
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

_QUOTED = re.compile(rb'"[^"]*"')


@dataclass(frozen=True, eq=False)
class Uneven:
    """The lines, counted from 0, that have more or fewer fields than they should."""

    more: NDArray[np.int64]
    fewer: NDArray[np.int64]


NONE_UNEVEN = Uneven(np.zeros(0, np.int64), np.zeros(0, np.int64))


def uneven_lines(data: bytes, delimiter: str, width: int, count: int) -> Uneven:
    """Of `count` lines in which quotes stand around whole fields. Without all other bytes most lines are the same."""
    mark = delimiter.encode()
    bare = data.translate(None, _others(mark))
    first = bare[: bare.find(b"\n") + 1]
    lines = [first[:-1]] * count if bare == first * count else bare.split(b"\n")[:count]
    too_many = {line: _QUOTED.sub(b"", line).count(mark) + 1 - width for line in set(lines)}
    if not any(too_many.values()):
        return NONE_UNEVEN
    each = np.fromiter(map(too_many.__getitem__, lines), np.int64, count)
    return Uneven(np.flatnonzero(each > 0), np.flatnonzero(each < 0))


@lru_cache
def _others(mark: bytes) -> bytes:
    return bytes(byte for byte in range(256) if byte not in mark + b'"\n')
