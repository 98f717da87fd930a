"""What a record's shapes say before any threshold: their log-odds, less what the rivals that stand out take."""

from dataclasses import dataclass

import numpy as np

from app.engine.features import Features, observe
from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.rivals import Rival, compete
from app.engine.verdict.shape_model import ShapeModel, fitted_model


@dataclass(frozen=True, eq=False)
class Weighing:
    """What one record's shapes say, before any threshold.

    log_odds: calibrated log-odds of stiction, less what the rivals that stand out take. window_spread: standard
    deviation of the log-odds between windows. contributions: (F,) to the log-odds of the logistic, in the order of
    `features.NAMES`. neutral: (F,) the value of each feature that speaks neither for nor against stiction. rivals: the
    strongest first.
    """

    log_odds: float
    window_spread: float
    contributions: FloatArray
    neutral: FloatArray
    features: Features
    rivals: tuple[Rival, ...]

    @property
    def probability(self) -> float:
        return _logistic(self.log_odds)

    @property
    def log_odds_by_shapes(self) -> float:
        """`log_odds` before the rivals were counted."""
        return self.log_odds + counted_against(self.rivals)

    @property
    def probability_by_shapes(self) -> float:
        return _logistic(self.log_odds_by_shapes)


def _logistic(log_odds: float) -> float:
    return 1.0 / (1.0 + float(np.exp(-np.clip(log_odds, -20.0, 20.0))))


def weigh(record: UniformRecord, oscillation: Oscillation, model: ShapeModel | None = None) -> Weighing | None:
    """The evidence of a record's shapes, or None if PV or OP does not vary.

    model: the fitted numbers; None for those that this version ships. Invariant to the unit, offset and sign of PV and
    OP and to the time unit.
    """
    features = observe(record, oscillation)
    if features is None:
        return None
    return weigh_features(features, compete(record, oscillation, features), model or fitted_model())


def weigh_features(features: Features, rivals: tuple[Rival, ...], model: ShapeModel) -> Weighing:
    """The same from features and rivals that were computed before."""
    return Weighing(
        log_odds=float(model.log_odds(features.values)) - counted_against(rivals),
        window_spread=float(np.std(model.log_odds(features.table))),
        contributions=model.contributions(features.values),
        neutral=model.centre,
        features=features,
        rivals=rivals,
    )


def counted_against(rivals: tuple[Rival, ...]) -> float:
    """What the rivals that stand out take from the log-odds of stiction."""
    return sum(rival.counts for rival in rivals if rival.stands_out)
