"""The development recordings as the engine sees them: label, uniform record, oscillation, features."""

import csv
from dataclasses import dataclass, replace
from pathlib import Path

from app.engine.features import Features, observe
from app.engine.fitness import Fitness, assess, with_cycles
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import Recording
from app.errors import DataError
from app.ingest import read_recordings


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
        features = observe(fitness.record, oscillation)
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
    """The one loop of a file, read as `loopaudit audit` reads it: what is trained on is what is audited.

    Raises DataError("columns") where the file does not hold exactly one loop with PV and OP.
    """
    recordings = read_recordings(path).recordings
    if len(recordings) != 1:
        raise DataError("columns", f"{path.name} holds {len(recordings)} loops with PV and OP; one is needed")
    return recordings[0]
