"""The development recordings as the engine sees them: label, uniform record, oscillation, features."""

import csv
from dataclasses import dataclass, replace
from pathlib import Path

from app.engine.features import Features, observe
from app.engine.fitness import Fitness
from app.engine.oscillation import Oscillation
from app.engine.preparation import prepare
from app.engine.recording import Recording
from app.engine.verdict.shape_model import ShapeModel
from app.errors import DataError
from app.ingest import read_recordings

STATED = "stated"
"""The tier of a label that the plant or the database itself gives, and of one that is given without a tier."""
_TRUST_OF_OTHERS = 0.25


@dataclass(frozen=True, eq=False)
class Labelled:
    """One recording with its label. features: None where PV or OP does not vary or the recording is not fit.

    tier: how sure the label is; one that is not `stated` is likely, or said by later literature only.
    """

    recording: Recording
    valve: str
    source: str
    tier: str
    cause: str
    sticky: bool
    fitness: Fitness
    oscillation: Oscillation | None
    features: Features | None

    @property
    def trust(self) -> float:
        """What the label counts in a fit.

        One that is right with probability r tells (2 r - 1)^2 of what a sure one does; one that is not stated is taken
        to be right three times of four.
        """
        return 1.0 if self.tier == STATED else _TRUST_OF_OTHERS


def labelled(folder: Path, model: ShapeModel | None = None) -> list[Labelled]:
    """The recordings of a folder with labels.csv, in its order. model: by which a stretch of a long record is the one
    to learn from; the shipped one where None, which has learnt from these recordings.
    """
    with (folder / "labels.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return [_labelled(row, read(folder / f"{row['recording']}.csv"), model) for row in rows]


def _labelled(row: dict[str, str], recording: Recording, model: ShapeModel | None) -> Labelled:
    integrating = {"True": True, "False": False}.get(row.get("integrating", ""))
    recording = replace(recording, integrating=integrating)
    prepared = prepare(recording, model=model)
    fitness, oscillation = prepared.fitness, prepared.oscillation
    features = None if oscillation is None else observe(fitness.audited, oscillation)
    return Labelled(
        recording,
        row["valve"],
        row["source"],
        row.get("tier") or STATED,
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
