"""Explained models simulated again: a model that `explain` wrote, driven by the OP of a recording, and compared with
it.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.engine.mismatch import Comparison, at_interval, simulate_again
from app.engine.mismatch.judge.result import ExplainedModel
from app.engine.recording import FloatArray
from app.errors import DataError, RequestError
from app.ingest import IngestOptions
from app.services.explaining.comparisons import Columns, read_comparison
from app.services.explaining.given_model import json_of, linear_model
from app.services.explaining.line import model_from_line

CLOSE = 0.01
# What tells a model that `explain` wrote, or a whole answer with it, from a linear one that somebody wrote down.
OF_EXPLAIN = {"plant", "parts", "model"}


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
    driven = as_fitted(model, comparison)
    pv = simulate_again(model, driven.op, driven.measured)
    return SimulatedRecord(np.arange(len(pv), dtype=np.float64) * model.sampling_interval_s, driven.op, pv)


def as_fitted(model: ExplainedModel, comparison: Comparison) -> Comparison:
    """The comparison at the interval of the model's own record. Raises DataError("interval_differs")."""
    if not (np.isfinite(model.sampling_interval_s) and model.sampling_interval_s > 0.0):
        raise DataError(
            "model_invalid", f"the model was fitted at {model.sampling_interval_s:g} s, more than 0 is needed"
        )
    ratio = model.sampling_interval_s / comparison.sampling_interval_s
    factor = max(round(ratio), 1)
    if abs(ratio / factor - 1.0) > CLOSE:
        fitted, got = model.sampling_interval_s, comparison.sampling_interval_s
        raise DataError("interval_differs", f"the model was fitted at {fitted:g} s, the recording has {got:g} s")
    return at_interval(comparison, factor)


def with_model(comparison: Comparison, text: str) -> Comparison:
    """The comparison with a model as its simulation, JSON or a file with it: a linear one, or one that `explain` wrote,
    simulated along its OP at the interval that it was fitted at.

    Raises DataError with the codes of `simulation_from_json` and of `simulate_model`.
    """
    found = json_of(text)
    if not (isinstance(found, dict) and OF_EXPLAIN & set(found)):
        return replace(comparison, trace=None, simulation=linear_model(found))
    model = model_from_line(found)
    driven = as_fitted(model, comparison)
    return replace(driven, trace=simulate_again(model, driven.op, driven.measured), simulation=None)


def simulate_files(model: Path, recording: Path, columns: Columns, options: IngestOptions) -> SimulatedRecord:
    return simulate_model(read_model(model), read_comparison(recording, columns, None, options))
