"""What a section is given: sizes, servers, a folder for files, and somebody to tell."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Figures = dict[str, Any]


class SkippedError(Exception):
    """A section, or a part of one, that cannot be measured here; the text says why."""


@dataclass(frozen=True)
class Sizes:
    """How much is measured: `full` is what docs/PERFORMANCE.md shows, `quick` is for seeing that all works."""

    loops: int
    scaling_loops: int
    nights: int
    lengths: tuple[int, ...]
    load_s: float
    peer_orders: int
    long_loops: int


FULL = Sizes(14_000, 2_000, 365, (500, 1_000, 2_000, 5_000, 10_000, 20_000, 50_000, 100_000), 6.0, 4, 14_000)
QUICK = Sizes(240, 120, 8, (500, 1_000, 2_000, 5_000), 1.5, 2, 240)


@dataclass(frozen=True)
class Bench:
    """postgres: address of a server on which databases may be made and dropped. redis: address of an empty Redis
    database. recordings: a folder with recordings of real loops (CHEM1.csv is FC145), or None."""

    sizes: Sizes
    postgres: str
    redis: str
    folder: Path
    recordings: Path | None
    tell: Callable[[str], None]
