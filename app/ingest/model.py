"""What ingest hands on: signals, a loop's samples, what could not be read, and what a file holds. Frozen, without
behaviour."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Signal = Literal["PV", "OP", "SP", "MODE", "OTHER"]
SIGNALS: tuple[Signal, ...] = ("PV", "OP", "SP", "MODE", "OTHER")

TimeArray = NDArray[np.int64]
NO_TIME = np.iinfo(np.int64).min
"""Among times, where a row has none that can be read."""

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class IngestOptions:
    """How a file is read.

    time_zone: IANA name of the zone in which time stamps without an offset were written.
    start_ns: the instant (ns since 1970, UTC) that second 0 of a file in relative seconds is given. The default is
        1970-01-01, so that the same file always gives the same samples.
    day_first: True or False where the caller knows whether day or month stands first in dates that can be read in both
        orders; None: found from the data.
    now_ns: the instant (ns since 1970, UTC) at which the file is read or came; samples are not later. None: no clock.
    max_ratio: what gzip may unpack to, in its own sizes, once that is more than 64 MiB. 2,000 columns that all
        stand still at values of their own pack 210 to 1, 2,000 zeros 510 to 1, signals with noise 3 to 1; 1,032 to 1
        is the most there is.
    buffered_values: how many values are gathered before they are put aside on disk, and how many of several loops are
        taken back at once; a row of a long table counts as three.
    spill_folder: where a large long file's rows are parted by loop on disk; None: where the system keeps such files.
    """

    time_zone: str = "UTC"
    start_ns: int = 0
    day_first: bool | None = None
    now_ns: int | None = None
    max_rejects: int = 1000
    max_name: int = 256
    chunk_bytes: int = 16 << 20
    max_line_bytes: int = 64 << 20
    max_bytes: int = 64 << 30
    max_ratio: float = 600.0
    max_signals: int = 1_000_000
    buffered_values: int = 12_000_000
    spill_folder: Path | None = None


@dataclass(frozen=True, eq=False)
class SignalBlock:
    """Samples of one tag, in order of time, without repeated times.

    time_ns: (n,) nanoseconds since 1970-01-01 UTC. value: (n,) engineering units, NaN where the row gave none; for
    MODE 1 is automatic or cascade, 0 manual, -1 not understood, NaN not written.
    """

    tag: str
    loop: str
    signal: Signal
    time_ns: TimeArray
    value: FloatArray


@dataclass(frozen=True, eq=False)
class LoopSamples:
    """A stretch of one loop's samples on one time base; a signal that the stretch does not hold is None, a missing
    value NaN.

    automatic: (n,) 1 automatic or cascade, 0 manual, -1 a mode that is not understood, NaN not written.
    others: further signals by tag.
    resampled: the signals that were sampled at other times than PV and were brought to PV's times (see `align`).
    """

    loop: str
    time_ns: TimeArray
    pv: FloatArray | None = None
    op: FloatArray | None = None
    sp: FloatArray | None = None
    automatic: FloatArray | None = None
    others: Mapping[str, FloatArray] = field(default_factory=lambda: MappingProxyType({}))
    resampled: tuple[str, ...] = ()

    @property
    def samples(self) -> int:
        return len(self.time_ns)


@dataclass(frozen=True)
class Reject:
    """A row or value that could not be used. `line` counts from 1 in the file as it came; None where no single line
    is at fault."""

    line: int | None
    code: str
    text: str
    tag: str = ""


@dataclass(frozen=True)
class Rejects:
    """All that could not be used: `counts` by code are exact, `listed` holds the first of them."""

    counts: Mapping[str, int]
    listed: tuple[Reject, ...]

    @property
    def total(self) -> int:
        return sum(self.counts.values())


@dataclass(frozen=True)
class LoopTags:
    """A loop and the tag of each of its signals (None where it has none)."""

    loop: str
    pv: str | None = None
    op: str | None = None
    sp: str | None = None
    mode: str | None = None
    others: tuple[str, ...] = ()


@dataclass(frozen=True)
class FileSummary:
    """What a file was found to hold. Counts are those of the rows read so far, complete once all blocks were taken.
    units: by tag, as a row or a column of units tells them."""

    layout: str
    encoding: str
    delimiter: str
    decimal_mark: str
    time_format: str
    time_zone: str
    compressed: bool
    tags: int
    loops: tuple[LoopTags, ...]
    rows_read: int
    rows_kept: int
    values_kept: int
    first_time_ns: int | None
    last_time_ns: int | None
    notes: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
