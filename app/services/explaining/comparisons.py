"""Files into comparisons: which column is OP, PV, SP, the simulation, and what else was measured."""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.engine.evidence import Reason
from app.engine.mismatch import Comparison, LinearSimulation
from app.engine.mismatch.compare.comparison import LEAST_SAMPLES
from app.engine.recording import BoolArray, FloatArray, Recording
from app.engine.signals.sampled import held
from app.errors import DataError, RequestError
from app.ingest import (
    SIMULATED,
    IngestOptions,
    NamedTable,
    RecordingsRead,
    names_no_measurement,
    read_named,
    read_recordings,
)
from app.services.explaining.aligning import Aligned, beyond, covering, onto, sample_by_sample

NOT_MEASURED = ("ts", "auto")
BRACKETS = re.compile(r"\s*[\[(][^\[\]()]*[\])]$")
GAP_INTERVALS = 3.0
SAME_STAMP = 0.01  # of an interval: so near a stamp a grid point is the sample
STAMP_ROUNDING = 1e-6  # of an interval: by so much a grid may miss the stamp that it was laid on
SPARSE = 3.0
READ_PLAINLY = IngestOptions()
A_SECOND_A_SAMPLE = (
    "no column tells times that can be read: samples are taken to be 1 s apart, and every time that is told rests on "
    "that; name the column time, or tell the interval in s in a column Ts"
)
NO_EXPORT = ("unknown_layout", "not_an_export", "nothing_readable")


@dataclass(frozen=True)
class Columns:
    """Names of columns, or of the loop in an export of several, as the user gave them; None: found by the usual
    names.
    """

    op: str | None = None
    pv: str | None = None
    sp: str | None = None
    loop: str | None = None

    @property
    def named(self) -> bool:
        """Whether a signal's column is named: then the file is a table with a header."""
        return self.op is not None or self.pv is not None or self.sp is not None


def check_is_file(path: Path) -> None:
    """Raises DataError("no_such_file") where it is none."""
    if not path.is_file():
        raise DataError("no_such_file", f"{path} is not there or not a file")


def read_table(path: Path, options: IngestOptions = READ_PLAINLY) -> NamedTable:
    """A delimited file or parquet with a header. Raises DataError where it is missing or is no table."""
    check_is_file(path)
    return read_named(path, options)


def named(names: Iterable[str], name: str) -> str | None:
    """Which of the names that is, in any case; None where none is."""
    there = list(names)
    return name if name in there else {one.strip().lower(): one for one in reversed(there)}.get(name.strip().lower())


def simulation_among(names: Iterable[str]) -> str | None:
    """The first usual name of a simulation, with or without its unit, any case."""
    by_lower = {name.strip().lower(): name for name in reversed(list(names))}
    without_unit = {BRACKETS.sub("", lower): name for lower, name in by_lower.items()}
    return next((name for usual in SIMULATED if (name := by_lower.get(usual) or without_unit.get(usual))), None)


def measured_beside(names: Iterable[str], taken: Collection[str | None]) -> list[str]:
    """Those of the names that may be causes: what is not taken, and no simulation, mode, quality or number of a row."""

    def is_other(name: str) -> bool:
        lower = name.strip().lower()
        return BRACKETS.sub("", lower) in SIMULATED or lower in NOT_MEASURED or names_no_measurement(name)

    return [name for name in names if name not in taken and not is_other(name)]


def asked_for(table: NamedTable, name: str | None, signal: Literal["PV", "OP", "SP"]) -> str | None:
    """The column of that name, or by its name that signal. Raises where a name that was given is not there."""
    if name is None:
        return table.column_of(signal)
    found = named(table.names, name)
    if found is None:
        raise RequestError("no_such_column", f"there is no column {name}; the file has {', '.join(table.names)}")
    return found


def seconds(table: NamedTable, signals: Collection[str | None] = ()) -> tuple[FloatArray, tuple[Reason, ...]]:
    """Times in s, and what is to be said of them; a second a sample where no column but the signals tells them."""
    time = None if set(table.time_columns) & set(signals) else times_of(table)
    if time is not None:
        return time, assumed(table.times_assumed)
    return np.arange(table.height, dtype=np.float64), assumed((A_SECOND_A_SAMPLE,))


def assumed(told: Iterable[str]) -> tuple[Reason, ...]:
    return tuple(Reason("times_assumed", text) for text in told)


def times_of(table: NamedTable) -> FloatArray | None:
    """Times in s: from numbers, from stamps, or by the constant interval in a column Ts; None where none are told."""
    time = table.times_s()
    if time is None:
        return None
    known = time[np.isfinite(time)]
    if len(known) == 1 and known[0] > 0.0:
        return np.arange(len(time)) * known[0]
    return time


def read_comparison(
    path: Path, columns: Columns, simulated: str | None, options: IngestOptions = READ_PLAINLY
) -> Comparison:
    """A recording file with the simulation named by `simulated`: a column of it, or a file with a simulated trace.

    Any layout that ingest reads, as long as no columns are named; a table with a header otherwise. Without `simulated`
    a column with a usual name (PV_sim) is taken; without that our own identified loop is the simulation.
    """
    return read_with_recording(path, columns, simulated, options).comparison


@dataclass(frozen=True, eq=False)
class Read:
    """A comparison, and the recording that the file holds with all that an audit knows of it; None where it was read as
    a table alone.
    """

    comparison: Comparison
    recording: Recording | None = None


def read_with_recording(
    path: Path, columns: Columns, simulated: str | None, options: IngestOptions = READ_PLAINLY
) -> Read:
    """As `read_comparison`, with the recording."""
    read = None if columns.named else exported(path, columns.loop, options)
    found = None if read is None else of_export(path, read, simulated, options)
    found = of_table(path, columns, simulated, options) if found is None else found
    return Read(found, None if read is None else read.recordings[0])


def exported(path: Path, loop: str | None, options: IngestOptions) -> RecordingsRead | None:
    """The loop's recording alone of an export of any layout; None where ingest finds no loop in it.

    Raises DataError("several_loops", "no_such_loop") where it is not clear which loop is meant.
    """
    check_is_file(path)
    try:
        read = read_recordings(path, options=options)
    except DataError as error:
        if error.code in NO_EXPORT:
            return None
        raise
    found = read.recordings
    if loop is not None:
        found = tuple(r for r in found if r.name.rpartition(":")[2].lower() == loop.lower())
        if not found:
            raise DataError("no_such_loop", f"{path} has no loop {loop} with PV and OP")
    if len(found) > 1:
        loops = ", ".join(r.name.rpartition(":")[2] for r in found[:8])
        raise DataError("several_loops", f"{path} holds {len(found)} loops ({loops}, ...); name one with --loop")
    return replace(read, recordings=found) if found else None


def of_export(path: Path, read: RecordingsRead, simulated: str | None, options: IngestOptions) -> Comparison | None:
    """A loop of an export against a simulation among its further signals, or in a file. None where only the table tells
    it: a column that is no signal of the loop, or a simulation without times, which belongs to the rows.
    """
    recording = read.recordings[0]
    said = (*damaged(read.damage), *in_doubt(read.doubts), *assumed(read.times_assumed))
    if is_file(simulated):
        laid = of_file(Path(simulated or ""), recording, read.starts_s.get(recording.name), options)
        if laid is None:
            return None
        found = comparison_of(measured_alone(recording, None), laid.trace)
        return replace(found, notes=(*said, *found.notes, *laid.notes))
    beside = simulation_among(recording.others) if simulated is None else named(recording.others, simulated)
    if beside is None and in_the_table(path, simulated, options):
        return None
    name = recorded_simulation(recording, simulated)
    found = comparison_of(measured_alone(recording, name), None if name is None else recording.others[name])
    return replace(found, notes=(*said, *found.notes))


def is_file(simulated: str | None) -> bool:
    try:
        return simulated is not None and Path(simulated).is_file()
    except (OSError, ValueError):  # a long text is no name
        return False


def of_file(path: Path, recording: Recording, start_s: float | None, options: IngestOptions) -> Aligned | None:
    """The simulation in a file, laid onto a recording whose second 0 is at `start_s` on the clock of its file; None
    where not both tell times.
    """
    other = read_table(path, options)
    time = times_of(other)
    if time is None or start_s is None:
        return None
    laid = onto(start_s + recording.time_s, time, other.numbers(simulated_column(other)))
    return replace(laid, notes=(*damaged(other.damage), *in_doubt(other.doubts()), *laid.notes))


def in_the_table(path: Path, simulated: str | None, options: IngestOptions) -> bool:
    """Whether the file is a table of one loop with that column, or without a name one that is called a simulation."""
    try:
        table = read_table(path, options)
    except DataError:
        return False
    there = simulation_among(table.names) if simulated is None else named(table.names, simulated)
    return there is not None and table.column_of("PV") is not None and table.column_of("OP") is not None


def recorded_simulation(recording: Recording, wanted: str | None) -> str | None:
    """The further signal of that name, or one with a usual name of a simulation. Raises RequestError("no_such_column")
    where one that was named is missing.
    """
    if wanted is None:
        return simulation_among(recording.others)
    found = named(recording.others, wanted)
    if found is None:
        there = ", ".join(recording.others) or "no further signal"
        text = f"{wanted!r} is no file and no signal of the loop; beside PV, OP and SP there is {there}"
        raise RequestError("no_such_column", text)
    return found


def measured_alone(recording: Recording, simulation: str | None) -> Recording:
    """The recording without what is no measurement: simulations and marks."""
    kept = measured_beside(recording.others, (simulation,))
    return replace(recording, others={name: recording.others[name] for name in kept})


def of_table(path: Path, columns: Columns, simulated: str | None, options: IngestOptions) -> Comparison:
    table = read_table(path, options)
    op, pv = asked_for(table, columns.op, "OP"), asked_for(table, columns.pv, "PV")
    if op is None or pv is None:
        missing = " and ".join(n for n, c in (("OP", op), ("PV", pv)) if c is None)
        raise DataError(
            "no_pv_op",
            f"{path} has no column for {missing}; name it with --op or --pv; it has {', '.join(table.names)}",
        )
    sp = asked_for(table, columns.sp, "SP")
    sp = None if columns.sp is None and sp in (op, pv) else sp
    trace_column, laid = simulated_trace(table, simulated, options, (op, pv))
    check_apart({"OP": op, "PV": pv, "SP": sp, "the simulation": trace_column})
    time, said = seconds(table, (op, pv, sp, trace_column))
    beside = measured_beside(table.names, {op, pv, sp, trace_column, *table.time_columns})
    others = {name: table.numbers(name) for name in beside if table.may_hold_numbers(name)}
    signals = {"op": some_numbers(table, op), "pv": some_numbers(table, pv)}
    signals |= {"sp": table.numbers(sp)} if sp is not None else {}
    signals |= {"trace": laid.trace} if laid is not None else {}
    found = uniform(path.name.partition(".")[0] if path.suffix == ".gz" else path.stem, time, signals, others)
    laid_notes = () if laid is None else laid.notes
    return replace(found, notes=(*damaged(table.damage), *in_doubt(table.doubts()), *said, *found.notes, *laid_notes))


def check_apart(columns: dict[str, str | None]) -> None:
    """Raises RequestError("same_column") where one column is taken for two signals."""
    taken: dict[str, str] = {}
    for signal, column in columns.items():
        if column is None:
            continue
        if column in taken:
            text = f"{taken[column]} and {signal} are both taken from the column {column}; they must be two"
            raise RequestError("same_column", text)
        taken[column] = signal


def in_doubt(doubts: Iterable[str]) -> tuple[Reason, ...]:
    return tuple(Reason("numbers_in_doubt", text) for text in doubts)


def damaged(lost: Iterable[str]) -> tuple[Reason, ...]:
    return tuple(Reason("samples_damaged", text) for text in lost)


def some_numbers(table: NamedTable, column: str) -> FloatArray:
    values = table.numbers(column)
    if not np.any(np.isfinite(values)):
        raise DataError("not_numeric", f"the column {column} has no numbers in it")
    return values


def comparison_of(
    recording: Recording, trace: FloatArray | None = None, simulation: LinearSimulation | None = None
) -> Comparison:
    """A stored recording against a simulated trace (N,) at its times, a model, or our own linear loop."""
    signals = {"op": recording.op, "pv": recording.pv}
    signals |= {"sp": recording.sp} if recording.sp is not None else {}
    if trace is not None and len(trace) != recording.samples:
        raise DataError(
            "simulation_length", f"the simulation has {len(trace)} samples, the recording {recording.samples}"
        )
    signals |= {"trace": trace} if trace is not None else {}
    found = uniform(recording.name, recording.time_s, signals, dict(recording.others))
    return found if trace is not None else replace(found, simulation=simulation)


def simulated_trace(
    table: NamedTable, simulated: str | None, options: IngestOptions, taken: tuple[str, ...] = ()
) -> tuple[str | None, Aligned | None]:
    """The column of the recording's table that holds the simulation, and the simulation; or that of a file, laid onto
    the recording's times where both tell them, else sample by sample. taken: columns that are OP or PV already, and
    none where no simulation is named.
    """
    if simulated is None or not is_file(simulated):
        column = simulation_among(table.names) if simulated is None else named(table.names, simulated)
        if simulated is not None and column is None:
            there = ", ".join(table.names)
            raise RequestError("no_such_column", f"there is no file and no column {simulated}; the file has {there}")
        column = None if simulated is None and column in taken else column
        return column, None if column is None else Aligned(table.numbers(column))
    other = read_table(Path(simulated), options)
    column = simulated_column(other)
    trace, time, other_time = other.numbers(column), times_of(table), times_of(other)
    if time is None or other_time is None:
        laid = sample_by_sample(table.height, trace)
    else:
        laid = onto(time, other_time, trace)
    return None, replace(laid, notes=(*damaged(other.damage), *in_doubt(other.doubts()), *laid.notes))


def simulated_column(table: NamedTable) -> str:
    """The column of a simulation's own table that is the simulation."""
    return simulation_among(table.names) or table.column_of("PV") or table.names[-1]


def uniform(name: str, time: FloatArray, signals: dict[str, FloatArray], others: dict[str, FloatArray]) -> Comparison:
    """Equal sampling at the median interval; trailing rows without PV and OP are left out, gaps are bridged and
    marked: by straight lines, but the set point holds, for it steps.
    """
    present = np.isfinite(time) & np.isfinite(signals["pv"]) & np.isfinite(signals["op"])
    if present.sum() < LEAST_SAMPLES:
        raise DataError(
            "too_short",
            f"{name} has {int(present.sum())} samples with time, PV and OP, at least {LEAST_SAMPLES} are needed",
        )
    order = np.flatnonzero(present)[np.argsort(time[present], kind="stable")]
    kept = np.concatenate(([True], np.diff(time[order]) > 0.0))
    notes = faults_of_the_clock(time[present], int(np.sum(~kept)))
    order = order[kept]
    if "trace" in signals:
        refuse_a_copy(signals["pv"][order], signals["trace"][order])
        notes += whole_trace(time, order, signals["trace"])
    at = time[order] - time[order[0]]
    interval = float(np.median(np.diff(at)))
    # Samples that came on change: a grid as fine as their usual distance would be mostly invented.
    interval = at[-1] / (len(at) - 1) if at[-1] / (len(at) - 1) > SPARSE * interval else interval
    grid = np.arange(int(np.floor(at[-1] / interval + 1e-6)) + 1) * interval
    known = known_at(grid, at, interval)
    even = len(grid) == len(at) and bool(np.allclose(grid, at, atol=SAME_STAMP * interval))

    def resampled(signal: FloatArray, *, steps: bool = False) -> FloatArray:
        values = signal[order]
        if even and np.all(np.isfinite(values)):
            return values
        finite = np.isfinite(values)
        if finite.sum() < 2:
            return np.full(len(grid), np.nan)
        known = at[finite], values[finite]
        return held(*known, grid + STAMP_ROUNDING * interval) if steps else np.interp(grid, *known)

    measured = tuple((n, s) for n, s in ((n, resampled(s)) for n, s in others.items()) if np.all(np.isfinite(s)))
    sp = resampled(signals["sp"], steps=True) if "sp" in signals else None
    return Comparison(
        name=name,
        sampling_interval_s=interval,
        op=resampled(signals["op"]),
        pv=resampled(signals["pv"]),
        sp=None if sp is None or not np.all(np.isfinite(sp)) else sp,
        measured=measured,
        known=None if even else known,
        trace=resampled(signals["trace"]) if "trace" in signals else None,
        notes=notes,
    )


def known_at(grid: FloatArray, at: FloatArray, interval: float) -> BoolArray:
    """(M,) True where a point of the grid (M,) is no invention: between samples, at the times (N,), that are no gap
    apart, and on a sample at the end of a gap.
    """
    behind = np.clip(np.searchsorted(at, grid), 1, len(at) - 1)
    before, after = at[behind - 1], at[behind]
    recorded = np.minimum(np.abs(grid - before), np.abs(after - grid)) <= SAME_STAMP * interval
    return recorded | (after - before < GAP_INTERVALS * interval)


def refuse_a_copy(pv: FloatArray, trace: FloatArray) -> None:
    """Raises DataError("simulation_is_pv") where a simulation (N,) is the recorded PV itself: no loop is simulated to
    the last digit of what was measured, and nothing would ever be missing.
    """
    if np.array_equal(pv, trace):
        text = "the simulation is PV itself, sample for sample: there is nothing to compare"
        raise DataError("simulation_is_pv", text)


def whole_trace(time: FloatArray, order: NDArray[np.int64], trace: FloatArray) -> tuple[Reason, ...]:
    """What is to be said of a simulation (N,) recorded at the times (N,) s, of which the samples `order` are compared.

    Raises DataError("simulation_length") where it does not cover them: as a line from its last value on it would be
    compared with what it has not simulated.
    """
    simulated = np.isfinite(time) & np.isfinite(trace)
    if simulated.sum() < 2:
        return ()  # refused as a simulation without values
    at = time[simulated]
    covering(time[order], np.sort(at))
    said = beyond(float(time[order[0]]), float(time[order[-1]]), at)
    within = order[(time[order] >= np.min(at)) & (time[order] <= np.max(at))]
    holes = int(np.sum(~np.isfinite(trace[within])))
    if not holes:
        return said
    text = f"{holes} samples of the simulation have no value and are bridged by straight lines"
    return (*said, Reason("simulation_bridged", text))


def faults_of_the_clock(time: FloatArray, repeated: int) -> tuple[Reason, ...]:
    """What times (N,) s in the order of the file hide: an hour that comes twice is sorted into the one before."""
    found = []
    if back := int(np.sum(np.diff(time) < 0.0)):
        text = f"time runs back {back} times; sorted by time, the samples of a clock that was set are mixed"
        found.append(Reason("time_runs_back", text))
    if repeated:
        found.append(Reason("times_repeated", f"{repeated} samples whose time was there before are left out"))
    return tuple(found)
