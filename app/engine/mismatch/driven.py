"""A model that explained one recording, driven by the OP of another."""

from dataclasses import dataclass

import numpy as np

from app.engine.mismatch.compare.comparison import Comparison, at_interval
from app.engine.mismatch.judge.result import ExplainedModel
from app.engine.mismatch.judge.validation import simulate_again
from app.engine.recording import FloatArray
from app.errors import DataError

_CLOSE = 0.01


@dataclass(frozen=True, eq=False)
class SimulatedRecord:
    """OP as it drove the model, and the PV that the model makes of it, in their units; (N,) each.

    time_s: (N,) s from the first sample.
    """

    time_s: FloatArray
    op: FloatArray
    pv: FloatArray


def simulate_model(model: ExplainedModel, comparison: Comparison) -> SimulatedRecord:
    """The model's free run along the OP of a comparison, from the state in which its own record began.

    Raises DataError("interval_differs") where the recording is not sampled as the model's, or a whole number of times
    faster.
    """
    driven = as_fitted(model, comparison)
    pv = simulate_again(model, driven.op, driven.measured)
    return SimulatedRecord(np.arange(len(pv), dtype=np.float64) * model.sampling_interval_s, driven.op, pv)


def as_fitted(model: ExplainedModel, comparison: Comparison) -> Comparison:
    """The comparison at the interval of the model's own record.

    Raises DataError("interval_differs") where that is not nearly a whole number of the comparison's, and
    "model_invalid" where it is no time.
    """
    if not (np.isfinite(model.sampling_interval_s) and model.sampling_interval_s > 0.0):
        raise DataError(
            "model_invalid", f"the model was fitted at {model.sampling_interval_s:g} s, more than 0 is needed"
        )
    ratio = model.sampling_interval_s / comparison.sampling_interval_s
    factor = max(round(ratio), 1)
    if abs(ratio / factor - 1.0) > _CLOSE:
        fitted, got = model.sampling_interval_s, comparison.sampling_interval_s
        raise DataError("interval_differs", f"the model was fitted at {fitted:g} s, the recording has {got:g} s")
    return at_interval(comparison, factor)
