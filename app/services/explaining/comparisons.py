"""Files into comparisons: which column is OP, PV, SP, the simulation, and what else was measured."""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from app.counting import counted
from app.engine.evidence import Reason
from app.engine.mismatch import Comparison
from app.engine.mismatch.compare.aligning import Aligned, onto, sample_by_sample
from app.engine.mismatch.compare.even_grid import comparison_of, uniform
from app.engine.recording import FloatArray, Recording
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
from app.services.telling import naming

NOT_MEASURED = ("ts", "auto")
BRACKETS = re.compile(r"\s*[\[(][^\[\]()]*[\])]$")
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
        loops = naming.named([r.name.rpartition(":")[2] for r in found])
        raise DataError("several_loops", f"{path} holds {counted(len(found), 'loop')} ({loops}); name one with --loop")
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


def has_simulation(path: Path, options: IngestOptions) -> bool:
    """Whether a file has a column with a usual name of a simulation, whatever else it has."""
    try:
        return simulation_among(read_table(path, options).names) is not None
    except DataError:
        return False


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
    found = uniform(name_of(path), time, signals, others)
    laid_notes = () if laid is None else laid.notes
    return replace(found, notes=(*damaged(table.damage), *in_doubt(table.doubts()), *said, *found.notes, *laid_notes))


def name_of(path: Path) -> str:
    """Of the recording in a file: the file's, without its suffix."""
    return path.name.partition(".")[0] if path.suffix == ".gz" else path.stem


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
