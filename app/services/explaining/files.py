"""The files that somebody wants explained, as what the engine compares."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from app.engine.long_records.stretches import LONG_SAMPLES
from app.engine.mismatch import Comparison
from app.engine.mismatch.compare.comparison import check
from app.engine.mismatch.compare.narrowing import narrowed
from app.engine.mismatch.second_recording import SecondRecordingError
from app.errors import DataError, LoopauditError, RequestError
from app.ingest import IngestOptions
from app.services.explaining.comparisons import Columns, has_simulation, is_file, read_with_recording
from app.services.explaining.line import Kind, Second
from app.services.explaining.models import with_model

OF_THE_CALL = frozenset({"no_such_file", "several_loops", "no_such_loop", "model_invalid"})
"""Codes of how the command was called. All others are of what the recording or its simulation holds."""


def is_unusable(error: DataError) -> bool:
    """Whether the recording that is to be explained, or its simulation, holds nothing that can be compared."""
    return not isinstance(error, SecondRecordingError) and error.code not in OF_THE_CALL


@dataclass(frozen=True)
class Asked:
    """A recording, at most one simulation of it (a column or a file; a model), and perhaps a second recording with its
    own columns. judged: of a long record only the part that an audit judges.
    """

    file: Path
    columns: Columns
    simulated: str | None
    model: str | None
    second: Path | None
    second_columns: Columns
    judged: bool
    options: IngestOptions


@dataclass(frozen=True, eq=False)
class Compared:
    """What is explained and what it is validated on. long: one loop is to explain a record that an audit would judge
    parts of.
    """

    first: Comparison
    kind: Kind
    second: Comparison | None = None
    told_second: Second | None = None
    long: bool = False


def explained_files(asked: Asked) -> Compared:
    """The files read, the second one's faults told as such. Raises DataError and RequestError where they cannot be
    compared, SecondRecordingError where it is the second one, RequestError("judged_alone") where part of a record has a
    simulation of the whole.
    """
    found = _first(asked)
    if asked.second is None:
        return found
    with _of_the_second(asked.second):
        column = None if is_file(asked.simulated) else asked.simulated
        second = read_with_recording(asked.second, asked.second_columns, column, asked.options).comparison
        second = second if asked.model is None else with_model(second, asked.model)
    return replace(found, second=second, told_second=Second(second.name, _kind(second, None, asked.model)))


def _first(asked: Asked) -> Compared:
    read = read_with_recording(asked.file, asked.columns, asked.simulated, asked.options)
    first = read.comparison if asked.model is None else with_model(read.comparison, asked.model)
    simulated = first.trace is not None or first.simulation is not None
    if asked.judged and simulated:
        raise RequestError("judged_alone", "--judged takes part of the record; a simulation is compared with all of it")
    if asked.judged:
        first = narrowed(first, read.recording)
    check(first)
    long = not (asked.judged or simulated) and len(first.pv) > LONG_SAMPLES
    return Compared(first, _kind(first, asked.simulated, asked.model), long=long)


def asked_kind(asked: Asked) -> Kind:
    """What a recording was to be compared with that cannot be."""
    if asked.model is not None:
        return "model"
    if asked.simulated is None:
        return "column" if has_simulation(asked.file, asked.options) else "identified"
    return "trace" if is_file(asked.simulated) else "column"


@contextmanager
def _of_the_second(path: Path) -> Iterator[None]:
    """What is wrong with the second recording is not taken for the first one's."""
    try:
        yield
    except LoopauditError as error:
        kind = SecondRecordingError if isinstance(error, DataError) else type(error)
        raise kind(error.code, f"in the second recording, {path}: {error.message}") from error


def _kind(comparison: Comparison, simulated: str | None, model: str | None) -> Kind:
    """What a recording is compared with."""
    if model is not None:
        return "model"
    if comparison.trace is None:
        return "identified"
    return "trace" if is_file(simulated) else "column"
