"""What a file holds, before anything is sent."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.ingest.align import EVEN, LONG
from app.ingest.exports.reading import read_export
from app.ingest.model import FileSummary, FloatArray, IngestOptions, LoopSamples, Rejects
from app.ingest.set_points import SetPoints
from app.ingest.tags.grouping import TagMapping
from app.nanoseconds import NS_PER_S


@dataclass(frozen=True)
class LoopReport:
    """One loop as the file has it. sampling_interval_s: the median step; even: all steps within 1 % of it.
    missing_share: of the rows of the loop, in the signal that has the fewest values. absent: rows that the interval
    makes between the others, and that are not there; none where rows come at times of their own."""

    loop: str
    samples: int
    signals: tuple[str, ...]
    first_time_ns: int
    last_time_ns: int
    sampling_interval_s: float | None
    even: bool
    missing_share: float
    resampled: tuple[str, ...]
    absent: int = 0

    @property
    def missing_of_span(self) -> float:
        """Share of the rows from the first to the last, with those that are absent, that have not all values."""
        return 1.0 - (1.0 - self.missing_share) * self.samples / (self.samples + self.absent)


@dataclass(frozen=True)
class InspectReport:
    """A file's summary, its loops, what would be refused, and the loops whose set point lies with OP, not with PV."""

    name: str
    size_bytes: int
    summary: FileSummary
    loops: tuple[LoopReport, ...]
    rejects: Rejects
    set_point_with_op: tuple[str, ...] = ()


def inspect(
    path: Path, *, filename: str | None = None, mapping: TagMapping | None = None, options: IngestOptions | None = None
) -> InspectReport:
    """Reads the whole file and keeps nothing of it but the report. Raises DataError where it is no export."""
    export = read_export(path, filename=filename, mapping=mapping, options=options)
    loops, set_points = [], SetPoints()
    for samples in export.loops():
        set_points.look(samples)
        loops.append(_report(samples))
    summary, rejects = export.summary(), export.rejects()
    size = path.stat().st_size
    return InspectReport(filename or path.name, size, summary, tuple(loops), rejects, set_points.with_op())


def _report(samples: LoopSamples) -> LoopReport:
    named = {"PV": samples.pv, "OP": samples.op, "SP": samples.sp, "MODE": samples.automatic, **samples.others}
    signals = {name: values for name, values in named.items() if values is not None}
    steps = np.diff(samples.time_ns) / NS_PER_S
    interval = float(np.median(steps)) if len(steps) else None
    missing = [float(np.mean(np.isnan(values))) for values in signals.values()]
    return LoopReport(
        samples.loop,
        samples.samples,
        tuple(signals),
        int(samples.time_ns[0]),
        int(samples.time_ns[-1]),
        interval,
        bool(interval is not None and np.all(np.abs(steps - interval) <= 0.01 * interval)),
        max(missing, default=0.0),
        samples.resampled,
        _absent(steps, interval),
    )


def _absent(steps: FloatArray, interval: float | None) -> int:
    """How many rows are left out in steps (n,), s: none of a loop that is stored when it changes."""
    if not interval or np.mean(steps <= EVEN * interval) < LONG:
        return 0
    return int(np.sum(np.rint(steps[steps > EVEN * interval] / interval) - 1.0))
