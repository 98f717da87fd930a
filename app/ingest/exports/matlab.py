"""MATLAB files (.mat of the versions 5 to 7): the International Stiction Data Base, and loops stored in its manner.

Attribute list of the database: Jelali and Huang 2010, Detection and Diagnosis of Stiction in Control Loops,
doi 10.1007/978-1-84882-775-2: `cdata.<industry>.loop<N>` with comments, type, sampling period in s, and t, SP, PV, OP.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from app.errors import DataError
from app.ingest.columns.plans import TimedColumns, ValueColumn, WidePlan, name_of
from app.ingest.exports.tables_in import Table, TableReader
from app.ingest.files.head import Head
from app.ingest.files.matlab_values import HEADER_BYTES, Structures, Value, is_matlab, read_variables
from app.ingest.model import FloatArray, IngestOptions
from app.ingest.rejecting import RejectLog
from app.ingest.times.stamps import SAMPLE, TimeForm, find_form

MOST_LOOPS = 10_000
MOST_NOTES = 20
INTERVAL_NAMES = ("ts", "sampling_period", "samplingperiod", "sampling_interval", "sampling_time", "dt")
TIME_NAMES = ("t", "time")
HELD = ("sp", "mode")  # which may be told once for all samples
INSTANTS = ("epoch", "serial")
SECONDS = TimeForm("relative")

# The prefixes by which the database's loops are cited.
INDUSTRIES = (
    ("chem", "CHEM"),
    ("pulp", "PAP"),
    ("pap", "PAP"),
    ("build", "BAS"),
    ("bas", "BAS"),
    ("pow", "POW"),
    ("min", "MIN"),
    ("met", "MET"),
)


@dataclass(frozen=True, eq=False)
class MatlabLoop:
    """One loop of the file. name: empty where the file itself is the loop. times: (n,), as `form` reads them."""

    name: str
    times: FloatArray
    form: TimeForm
    signals: dict[str, FloatArray]


class MatlabSource:
    """A MATLAB file whose loops are known: a group of columns a loop, because each has its own sampling period."""

    encoding = "matlab"
    compressed = False

    damage: tuple[str, ...] = ()  # a damaged one is refused whole
    share_taken = 1.0

    def __init__(self, path: Path, stem: str, options: IngestOptions) -> None:
        self.notes: list[str] = []
        found = sorted(self._loops(read_variables(path, options), options), key=lambda loop: -len(loop.times))
        if not found:
            told = "; ".join(self.notes[:3])
            raise DataError(
                "unknown_layout",
                "the MATLAB file has no structure with PV and OP and a sampling period Ts or times t"
                + (f" ({told})" if told else ""),
            )
        self._columns = [column for loop in found for column in (loop.times, *loop.signals.values())]
        names = [name for loop in found for name in ("t", *(tag_of(loop, signal) for signal in loop.signals))]
        self._table = Table(len(names), len(found[0].times), tuple(names), self._part)
        self.plan = WidePlan("isdb_matlab", 1, len(names), tuple(groups_of(found)))
        self.head = Head(stem, ("\t".join(names),), (tuple(names),), "", ".")

    def reader(self, width: int, types: dict[int, pl.DataType], log: RejectLog) -> TableReader:
        return TableReader(self._table, types, False)

    def _part(self, offset: int, count: int, columns: Sequence[int]) -> pl.DataFrame:
        """Rows of all loops side by side; where a loop has ended its columns are empty."""
        count = max(0, min(count, self._table.height - offset))
        return pl.DataFrame(
            [
                pl.Series(name_of(index), found, dtype=pl.Float64).extend_constant(None, count - len(found))
                for index in columns
                for found in (self._columns[index][offset : offset + count],)
            ]
        )

    def _loops(self, variables: dict[str, Value], options: IngestOptions) -> Iterator[MatlabLoop]:
        for number, (path, fields) in enumerate(structures(variables, ())):
            if number == MOST_LOOPS:
                raise DataError("too_many_tags", f"the MATLAB file has more than {MOST_LOOPS:,} loops")
            name = loop_name(path)
            loop = loop_of(name, fields, options)
            if isinstance(loop, MatlabLoop):
                yield loop
            elif len(self.notes) < MOST_NOTES:
                self.notes.append(f"{name or 'the file'} was left out: {loop}")


def open_matlab(path: Path, stem: str, options: IngestOptions) -> MatlabSource | None:
    """The file as loops of MATLAB structures, or None where it is no MATLAB file."""
    with path.open("rb") as stream:
        start = stream.read(HEADER_BYTES)
    return MatlabSource(path, stem, options) if is_matlab(start) else None


def groups_of(loops: list[MatlabLoop]) -> Iterator[TimedColumns]:
    first = 0
    for loop in loops:
        values = tuple(ValueColumn(first + 1 + i, tag_of(loop, signal)) for i, signal in enumerate(loop.signals))
        yield TimedColumns((first,), loop.form, values)
        first += 1 + len(values)


def tag_of(loop: MatlabLoop, signal: str) -> str:
    return f"{loop.name}.{signal.upper()}" if loop.name else signal.upper()


def structures(fields: dict[str, Value], path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], dict[str, Value]]]:
    """Every structure that has PV and OP, with the names that lead to it; nothing is looked for inside of one."""
    if {"pv", "op"} <= {name.lower() for name in fields}:
        yield path, fields
        return
    for name, value in fields.items():
        if isinstance(value, Structures):
            for number, inner in enumerate(value.elements, start=1):
                yield from structures(inner, (*path, name if len(value.elements) == 1 else f"{name}{number}"))


def loop_name(path: tuple[str, ...]) -> str:
    """cdata.chemicals.loop19 as CHEM19, the name by which it is cited; other paths as they stand."""
    found = re.fullmatch(r"loop_?(\d+)", path[-1], re.IGNORECASE) if len(path) > 1 else None
    if found is None:
        return ".".join(path)
    industry = path[-2].lower()
    prefix = next((short for start, short in INDUSTRIES if industry.startswith(start)), None)
    return f"{prefix}{found.group(1)}" if prefix else ".".join(path[-2:])


def loop_of(name: str, fields: dict[str, Value], options: IngestOptions) -> MatlabLoop | str:
    """The loop, or what is wrong with it in words."""
    values = {field.lower(): value for field, value in fields.items() if isinstance(value, np.ndarray)}
    pv, op = values.get("pv"), values.get("op")
    if pv is None or op is None or len(pv) != len(op) or len(pv) < 2:
        return f"PV and OP must be two columns of numbers of one length, got {told(pv)} and {told(op)}"
    found = times(values, len(pv), options)
    if found is None:
        return "it has no sampling period Ts above 0 s, and no rising times t as long as PV"
    signals = {"pv": pv, "op": op}
    for signal in HELD:
        held = values.get(signal)
        if held is not None and len(held) in (1, len(pv)):
            signals[signal] = np.broadcast_to(held, len(pv)).copy()
    return MatlabLoop(name, *found, signals)


def told(values: FloatArray | None) -> str:
    return "no numbers" if values is None else f"{len(values):,} values" if len(values) != 1 else "1 value"


def times(values: dict[str, FloatArray], samples: int, options: IngestOptions) -> tuple[FloatArray, TimeForm] | None:
    """The times t where they rise and there are as many as samples, else multiples of the sampling period."""
    for name in TIME_NAMES:
        time = values.get(name)
        if time is not None and len(time) == samples and np.all(np.isfinite(time)) and np.all(np.diff(time) > 0.0):
            return counted(name, time, options)
    for name in INTERVAL_NAMES:
        interval = values.get(name)
        if interval is not None and len(interval) == 1 and 0.0 < interval[0] < np.inf:
            return np.arange(samples) * interval[0], SECONDS
    return None


def counted(name: str, time: FloatArray, options: IngestOptions) -> tuple[FloatArray, TimeForm]:
    """What a column of such numbers counts in a table: days since year 0 (datenum), or seconds since 1970, or else
    seconds from the first one."""
    form = find_form([repr(float(number)) for number in time[:SAMPLE]], name, options)
    return (time, form) if form is not None and form.kind in INSTANTS else (time - time[0], SECONDS)
