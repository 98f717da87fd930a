"""Explained models simulated again: a model that `explain` wrote, driven by the OP of a recording, and compared with
it.
"""

import json
from dataclasses import replace
from pathlib import Path

from app.engine.mismatch import Comparison, simulate_again
from app.engine.mismatch.driven import SimulatedRecord, as_fitted, simulate_model
from app.engine.mismatch.judge.result import ExplainedModel
from app.errors import RequestError
from app.ingest import IngestOptions
from app.services.explaining.comparisons import Columns, read_comparison
from app.services.explaining.given_model import json_of, linear_model
from app.services.explaining.line import model_from_line

# What tells a model that `explain` wrote, or a whole answer with it, from a linear one that somebody wrote down.
OF_EXPLAIN = {"plant", "parts", "model"}


def read_model(path: Path) -> ExplainedModel:
    """A model, or a whole answer of `explain --format json` with the model in it."""
    try:
        return model_from_line(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError) as error:
        raise RequestError("model_invalid", f"{path} cannot be read as a model: {error}") from error


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
