"""The development recordings as the engine sees them: label, uniform record, oscillation, features."""

import csv
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from app.engine.features import Features, extract
from app.engine.fitness import Fitness, assess, with_cycles
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import FloatArray, Recording
from app.errors import DataError

_AUTOMATIC = ("AUTO", "CAS", "CASCADE", "RCAS")


@dataclass(frozen=True, eq=False)
class Labelled:
    """One recording with its label. features: None where PV or OP does not vary or the recording is not fit."""

    recording: Recording
    valve: str
    source: str
    tier: str
    cause: str
    sticky: bool
    fitness: Fitness
    oscillation: Oscillation | None
    features: Features | None


def labelled(folder: Path) -> list[Labelled]:
    """The recordings of a folder with labels.csv, in its order."""
    with (folder / "labels.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return [_labelled(row, read(folder / f"{row['recording']}.csv")) for row in rows]


def _labelled(row: dict[str, str], recording: Recording) -> Labelled:
    integrating = {"True": True, "False": False}.get(row.get("integrating", ""))
    recording = replace(recording, integrating=integrating)
    fitness = assess(recording)
    oscillation = features = None
    if fitness.record is not None and fitness.auditable:
        oscillation = detect(fitness.record)
        fitness = with_cycles(fitness, oscillation)
        features = extract(fitness.record, oscillation)
    return Labelled(
        recording,
        row["valve"],
        row["source"],
        row["tier"],
        row["cause"],
        row["label"] == "stiction",
        fitness,
        oscillation,
        features,
    )


def read(path: Path) -> Recording:
    """A file with columns time, PV, OP and maybe SP and MODE; times in seconds or ISO time stamps.

    Raises DataError("columns") where PV or OP is missing.
    """
    frame = pl.read_csv(path, infer_schema_length=None)
    columns = {name.upper(): frame[name] for name in frame.columns}
    if not {"TIME", "PV", "OP"} <= set(columns):
        raise DataError("columns", f"{path.name} has columns {', '.join(frame.columns)}; time, PV and OP are needed")
    time_s = _seconds(columns["TIME"])
    order = np.argsort(time_s, kind="stable")
    order = order[np.isfinite(time_s[order])]
    order = order[np.diff(time_s[order], prepend=-np.inf) > 0]
    sp = _numbers(columns["SP"])[order] if "SP" in columns else None
    mode = columns.get("MODE")
    automatic = None if mode is None else np.isin(mode.to_numpy().astype(str), _AUTOMATIC)[order]
    return Recording(
        name=path.stem,
        time_s=time_s[order] - time_s[order][0],
        pv=_numbers(columns["PV"])[order],
        op=_numbers(columns["OP"])[order],
        sp=None if sp is None or np.isfinite(sp).mean() < 0.5 else sp,
        automatic=automatic,
    )


def _numbers(column: pl.Series) -> FloatArray:
    return column.cast(pl.Float64, strict=False).fill_null(float("nan")).to_numpy().astype(float)


def _seconds(column: pl.Series) -> FloatArray:
    numbers = _numbers(column)
    if np.isfinite(numbers).any():
        return numbers
    stamps = column.str.to_datetime(strict=True)
    return ((stamps - stamps[0]).dt.total_milliseconds() / 1000.0).to_numpy().astype(float)
