"""Explained models simulated again: a model that `explain` wrote, driven by the OP of a recording."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.engine.mismatch import Comparison, at_interval, simulate_again
from app.engine.mismatch.result import ExplainedModel
from app.engine.recording import FloatArray
from app.errors import DataError, RequestError
from app.ingest import IngestOptions
from app.services.explaining.comparisons import Columns, read_comparison
from app.services.explaining.line import model_from_line

CLOSE = 0.01


@dataclass(frozen=True, eq=False)
class SimulatedRecord:
    """OP as it drove the model, and the PV that the model makes of it; (N,) each."""

    time_s: FloatArray
    op: FloatArray
    pv: FloatArray


def read_model(path: Path) -> ExplainedModel:
    """A model, or a whole answer of `explain --format json` with the model in it."""
    try:
        return model_from_line(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise RequestError("model_invalid", f"{path} cannot be read as a model: {error}") from error


def simulate_model(model: ExplainedModel, comparison: Comparison) -> SimulatedRecord:
    """The model's free run along the OP of a comparison, from the state in which its own record began.

    Raises DataError("interval_differs") where the recording is not sampled as the model's, or a whole number of times
    faster.
    """
    ratio = model.sampling_interval_s / comparison.sampling_interval_s
    factor = max(round(ratio), 1)
    if abs(ratio / factor - 1.0) > CLOSE:
        fitted, got = model.sampling_interval_s, comparison.sampling_interval_s
        raise DataError("interval_differs", f"the model was fitted at {fitted:g} s, the recording has {got:g} s")
    driven = at_interval(comparison, factor)
    pv = simulate_again(model, driven.op, driven.measured)
    return SimulatedRecord(np.arange(len(pv), dtype=np.float64) * model.sampling_interval_s, driven.op, pv)


def simulate_files(model: Path, recording: Path, columns: Columns, options: IngestOptions) -> SimulatedRecord:
    return simulate_model(read_model(model), read_comparison(recording, columns, None, options))
