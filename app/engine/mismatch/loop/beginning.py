"""The start of a record: PV still answers what OP did before it, which no free run knows."""

import numpy as np

from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.recording import BoolArray

_FURTHER_LAGS = 3.0
_MOST_SHARE = 20  # of the record's samples, one in so many
_LEAST_LEFT = 100


def answers_the_record(record: Experiment, plant: Plant) -> BoolArray:
    """(N,) True where PV is compared and what OP did before the record has passed through dead time and further lags.

    The states of the first lag, or of what swings, are free in every fit; behind them the model takes OP for constant
    before the record. Where it was not, an inverse response or a step would be named for it.
    """
    passed = (plant.theta + _FURTHER_LAGS * plant.tau2) / record.sampling_interval_s
    most = min(record.samples // _MOST_SHARE, max(int(record.usable.sum()) - _LEAST_LEFT, 0))
    usable = record.usable.copy()
    usable[: min(int(np.ceil(passed)), most)] = False
    return usable
