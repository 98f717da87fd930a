"""Files to recordings of the engine: what `loopaudit audit` reads."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np

from app.engine.recording import Recording
from app.ingest.align import carried
from app.ingest.exports.reading import read_export
from app.ingest.model import FloatArray, IngestOptions, LoopSamples, Reject, TimeArray
from app.ingest.set_points import loops_with_op
from app.ingest.tags.grouping import TagMapping
from app.nanoseconds import NS_PER_S


@dataclass(frozen=True, eq=False)
class RecordingsRead:
    """The recordings of a file, what was refused (the first of it; `reject_counts` has all by code), and the loops
    passed over. `damage`: what of the file itself was lost on its way. `starts_s`: by name of the recording, where on
    the clock of them all its second 0 is, s; empty where each may have a clock of its own. `dated`: whether that clock
    counts from 1970, UTC. `times_assumed`: what was taken for times where no column is named so. `set_point_with_op`:
    the loops whose set point lies with OP and not with PV."""

    recordings: tuple[Recording, ...]
    rejects: tuple[Reject, ...]
    skipped: tuple[str, ...]
    reject_counts: Mapping[str, int]
    notes: tuple[str, ...]
    damage: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    loops: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    starts_s: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    dated: bool = False
    times_assumed: tuple[str, ...] = ()
    set_point_with_op: tuple[str, ...] = ()


def read_recordings(
    path: Path, *, mapping: TagMapping | None = None, options: IngestOptions | None = None
) -> RecordingsRead:
    """Every loop of a file that has PV and OP, as a recording; a file of one loop names it by the file, one of
    several by file and loop.

    Raises DataError where the file is no export at all.
    """
    export = read_export(path, mapping=mapping, options=options)
    loops = {samples.loop: samples for samples in export.loops()}
    audited = {loop: samples for loop, samples in loops.items() if samples.pv is not None and samples.op is not None}
    single = len(audited) == 1
    names = {export.stem if single else f"{export.stem}:{loop}": loop for loop in audited}
    rejects = export.rejects()
    return RecordingsRead(
        recordings=tuple(to_recording(audited[loop], name) for name, loop in names.items()),
        rejects=rejects.listed,
        skipped=tuple(_skipped(loops, audited)),
        reject_counts=rejects.counts,
        notes=export.notes(),
        damage=export.damage(),
        doubts=export.doubts(),
        loops=MappingProxyType(names),
        starts_s=MappingProxyType(_starts_s(audited, names) if export.on_one_clock() else {}),
        dated=export.bears_dates(),
        times_assumed=export.times_assumed(),
        set_point_with_op=loops_with_op(audited.values()),
    )


def _skipped(loops: Mapping[str, LoopSamples], audited: Mapping[str, LoopSamples]) -> list[str]:
    skipped = []
    for loop, samples in loops.items():
        if loop in audited or (samples.pv is None and samples.op is None and samples.sp is None):
            continue
        missing = [name for name, signal in (("PV", samples.pv), ("OP", samples.op)) if signal is None]
        beside = f"; beside it there is {', '.join(list(samples.others)[:5])}" if samples.others else ""
        skipped.append(f"{loop}: no {' and no '.join(missing)}{beside}")
    return skipped


def to_recording(samples: LoopSamples, name: str) -> Recording:
    """A loop's samples as the engine takes them: seconds from the first sample, rows without PV and OP left out.

    Set point and mode hold until their next known value.
    """
    pv, op = _or_missing(samples.pv, samples), _or_missing(samples.op, samples)
    given = np.isfinite(pv) | np.isfinite(op)
    time_ns = samples.time_ns[given]
    start = time_ns[0] if len(time_ns) else 0
    automatic = samples.automatic
    return Recording(
        name,
        (time_ns - start) / NS_PER_S,
        pv[given],
        op[given],
        sp=None if samples.sp is None else carried(samples.sp)[given],
        automatic=None if automatic is None or not np.any(automatic >= 0.0) else _flags(automatic)[given],
        others=MappingProxyType({tag: values[given] for tag, values in samples.others.items()}),
    )


def second_zero_ns(time_ns: TimeArray, pv: FloatArray | None, op: FloatArray | None) -> int:
    """The instant of a recording's second 0: its first sample (of one or more) with PV or OP."""
    given = np.zeros(len(time_ns), dtype=np.bool_)
    for signal in (pv, op):
        if signal is not None:
            given |= np.isfinite(signal)
    return int(time_ns[np.argmax(given)])


def _starts_s(audited: Mapping[str, LoopSamples], names: Mapping[str, str]) -> dict[str, float]:
    loops = {name: audited[loop] for name, loop in names.items()}
    return {name: second_zero_ns(one.time_ns, one.pv, one.op) / NS_PER_S for name, one in loops.items() if one.samples}


def _or_missing(signal: np.ndarray | None, samples: LoopSamples) -> np.ndarray:
    return np.full(samples.samples, np.nan) if signal is None else signal


def _flags(automatic: np.ndarray) -> np.ndarray:
    """Where no mode is written the last one goes on, and before the first the first. One that is not understood is not
    taken for automatic: what was recorded under it is not audited, unless none is understood: then nothing is known
    of modes."""
    first = automatic[np.argmax(np.isfinite(automatic))]
    held = carried(automatic)
    return np.where(np.isnan(held), first, held) == 1


__all__ = ["RecordingsRead", "read_recordings", "second_zero_ns", "to_recording"]
