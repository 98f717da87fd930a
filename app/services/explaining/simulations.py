"""What people give as the simulation of a stored recording (a trace, a column, a model), kept until it is compared."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, tzinfo
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import polars as pl

from app.counting import counted
from app.engine.evidence import Reason
from app.engine.mismatch import Comparison
from app.engine.mismatch.compare.aligning import Aligned, onto
from app.engine.mismatch.compare.comparison import LEAST_SAMPLES, check
from app.engine.mismatch.compare.even_grid import comparison_of
from app.engine.recording import FloatArray, Recording
from app.errors import DataError, RequestError
from app.ingest import NO_TIME, IngestOptions, parse_named, read_instants
from app.nanoseconds import NS_PER_S
from app.services.auditing.recordings import origin_ns, recording_of
from app.services.explaining.comparisons import (
    in_doubt,
    measured_alone,
    recorded_simulation,
    simulated_column,
)
from app.services.explaining.given_model import simulation_from_json
from app.services.explaining.line import Kind
from app.services.moments import ns_of
from app.storage.documents import Document
from app.storage.loops import LoopRow
from app.storage.samples import Samples, TimeArray

LARGEST_TRACE = 200_000


@dataclass(frozen=True, eq=False)
class GivenTrace:
    """values: a simulated PV, None where it has none. time: instants, or seconds, or None: a value a sample."""

    values: Sequence[float | None]
    time: Sequence[datetime] | Sequence[float] | None = None


@dataclass(frozen=True, eq=False)
class GivenSimulation:
    """At most one of them. None of them: a column of the recording with a usual name, or else our own linear loop.

    csv: a table with a simulated PV and perhaps its times; column: a signal that was recorded with the loop; model:
    gain, time constants, dead time, as `loopaudit explain --sim-model` takes a linear one.
    """

    trace: GivenTrace | None = None
    csv: str | None = None
    column: str | None = None
    model: Mapping[str, Any] | None = None

    @property
    def stated(self) -> list[str]:
        """Which of them are given."""
        return [name for name, value in vars(self).items() if value is not None]


def kept(given: GivenSimulation, samples: Samples, recording: Recording, zone: str) -> Document | None:
    """What is stored with the request; None: our own linear loop. `zone` is that of stamps which name none.

    Raises RequestError or DataError where more than one is given, or what is given cannot be used.
    """
    if len(given.stated) > 1:
        raise RequestError(
            "several_simulations", f"{' and '.join(given.stated)} are given; one simulation can be compared"
        )
    if given.model is not None:
        return Document({"kind": "model", "model": checked_model(given.model)})
    options = IngestOptions(time_zone=zone, start_ns=origin_ns(samples))
    if given.trace is not None:
        return _kept_trace(given.trace, samples, recording, options)
    if given.csv is not None:
        return _kept_csv(given.csv, samples, recording, options)
    column = recorded_simulation(recording, given.column)
    return None if column is None else Document({"kind": "column", "column": column})


def comparison_with(
    loop: LoopRow, samples: Samples, simulation: Document | None, said: tuple[Reason, ...] = ()
) -> Comparison:
    """A loop's stored samples against the simulation that was kept; checked, so that the engine can take it. said: of
    the samples, before what else is noted.

    Raises DataError with the codes of the engine ("too_short", "signal_constant", ...) and of times that do not meet
    ("no_overlap", "simulation_length").
    """
    recording = recording_of(loop, samples)
    usable = int(np.sum(np.isfinite(recording.pv) & np.isfinite(recording.op)))
    if usable < LEAST_SAMPLES:
        raise DataError(
            "too_short",
            f"the window has {counted(usable, 'sample')} with PV and OP, at least {LEAST_SAMPLES} are needed",
        )
    told = {} if simulation is None else simulation.told
    measured = measured_alone(recording, told.get("column"))
    laid = None if simulation is None else _trace(recording, simulation, origin_ns(samples))
    model = simulation_from_json(json.dumps(told["model"])) if told.get("kind") == "model" else None
    found = comparison_of(measured, None if laid is None else laid.trace, model)
    check(found)
    notes = (*said, *in_doubt(told.get("doubts", ())), *found.notes, *(() if laid is None else laid.notes))
    return replace(found, notes=notes)


def kind_of(simulation: Document | None) -> Kind:
    return "identified" if simulation is None else simulation.told["kind"]


def checked_model(model: Mapping[str, Any]) -> dict[str, Any]:
    """The model as JSON, its figures not looked at. Raises DataError("model_invalid") where it is no model."""
    try:
        text = json.dumps(dict(model), allow_nan=False)
    except ValueError as error:
        raise DataError("model_invalid", f"the model has a number that is none: {error}") from error
    simulation_from_json(text)
    return dict(model)


def _kept_csv(text: str, samples: Samples, recording: Recording, options: IngestOptions) -> Document:
    """The simulated PV of a table at its times. Raises DataError where it is no table with numbers."""
    table = parse_named(text, options)
    column = simulated_column(table)
    if column in table.time_columns:
        raise DataError("no_simulation", "the CSV has a column of times only; a column PV_sim is needed")
    times = None if table.times is None else _read_times(table.times, options)
    placed = _placed(table.numbers(column), times, samples, recording)
    return replace(placed, told={**placed.told, "doubts": list(table.doubts())})


def _kept_trace(given: GivenTrace, samples: Samples, recording: Recording, options: IngestOptions) -> Document:
    values = np.array([np.nan if value is None else value for value in given.values], dtype=np.float64)
    if given.time is None:
        return _placed(values, None, samples, recording)
    if given.time and isinstance(given.time[0], datetime):
        return _placed(values, _instants(given.time, ZoneInfo(options.time_zone)), samples, recording)  # type: ignore[arg-type]
    return _placed(values, _read_times(pl.Series(given.time, dtype=pl.Float64), options), samples, recording)


def _read_times(column: pl.Series, options: IngestOptions) -> TimeArray:
    """(N,) ns since 1970; NO_TIME where there is none. As exports are read: stamps, seconds since 1970, or seconds."""
    times = read_instants(column, options)
    if times is None and len(column):
        raise DataError(
            "bad_times",
            f"the times of the simulation ({column[0]!r}, ...) are not understood; ISO 8601 or s are needed",
        )
    return np.zeros(0, np.int64) if times is None else times


def _placed(values: FloatArray, at_ns: TimeArray | None, samples: Samples, recording: Recording) -> Document:
    """Simulated values (N,) at their times, or one for each sample of the recording."""
    if len(values) > LARGEST_TRACE:
        raise RequestError(
            "simulation_too_large", f"the simulation has {len(values):,} samples, at most {LARGEST_TRACE:,} are taken"
        )
    if at_ns is None:
        if len(values) != recording.samples:
            raise DataError(
                "simulation_length",
                f"the simulation has {counted(len(values), 'sample')} and no times, the recording has "
                f"{recording.samples:,}",
            )
        at_ns = origin_ns(samples) + np.round(recording.time_s * NS_PER_S).astype(np.int64)
    if len(at_ns) != len(values):
        raise DataError(
            "simulation_length",
            f"{counted(len(at_ns), 'time was', 'times were')} given for {counted(len(values), 'simulated value')}",
        )
    known = at_ns != NO_TIME
    at_ns, once = np.unique(at_ns[known], return_index=True)
    return Document({"kind": "trace"}, Samples(at_ns, {"simulation": values[known][once]}))


def _instants(moments: Sequence[datetime], zone: tzinfo) -> TimeArray:
    zoned = [moment if moment.tzinfo else moment.replace(tzinfo=zone) for moment in moments]
    return np.array([ns_of(moment) for moment in zoned], dtype=np.int64)


def _trace(recording: Recording, simulation: Document, first_ns: int) -> Aligned | None:
    if simulation.told["kind"] == "column":
        name = recorded_simulation(recording, simulation.told["column"])
        return Aligned(recording.others[name or ""])
    if simulation.signals is None:
        return None
    time_s = (simulation.signals.time_ns - first_ns) / NS_PER_S
    return onto(recording.time_s, time_s, simulation.signals.signals["simulation"])
