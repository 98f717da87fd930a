"""Whether a linear loop under a Gaussian load would look as sticky: the record against its linear surrogates."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from app.engine.features import Part, observe_parts, parts_of
from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.surrogates import linear_surrogates
from app.engine.verdict.shape_model import ShapeModel

MOST_CHANCE = 0.02
"""Above it, stiction is not told from a linear loop."""

_STAGES = ((5, 0.004, 0.3), (10, 0.01, 0.15), (19, MOST_CHANCE, MOST_CHANCE))
"""After so many surrogates it is enough where the chance is below the first bound or above the second; most records
that stick need five."""


@dataclass(frozen=True)
class LookAlikes:
    """chance: the probability that a linear surrogate of the record looks at least as sticky as it does.

    surrogates: how many were looked at.
    """

    chance: float
    surrogates: int

    @property
    def shown(self) -> bool:
        """Whether the record is stickier than a linear loop with its spectra is."""
        return self.chance <= MOST_CHANCE


def look_alikes(record: UniformRecord, oscillation: Oscillation, log_odds: float, model: ShapeModel) -> LookAlikes:
    """How likely a linear loop with the spectra of the record has these log-odds of its shapes, or higher ones.

    Student's t for one more draw from a normal population of which a few are known. Where the shapes are those of the
    whole and of the rest of its set point, each of the two has its surrogates: those of the whole have lost what goes
    with the set point, by which that rest is found. Log-odds are not quite normal, and asking after 5, 10 and 19 is
    asking thrice: of 900 linear records 3.5 % had a chance of MOST_CHANCE or less, not 2 %. What is not linear without
    a valve that sticks (corners from elsewhere, a sensor in steps, OP at its limit) is not told from stiction: the
    rivals are asked of that.
    """
    parts = parts_of(record, oscillation)
    alike = zip(*(_look_alikes_of(part, seed) for seed, part in enumerate(parts)), strict=True)
    drawn: list[float] = []
    chance = 1.0
    for count, clear, hopeless in _STAGES:
        while len(drawn) < count:
            features = observe_parts(next(alike))
            if features is None:
                return LookAlikes(1.0, len(drawn))
            drawn.append(float(model.log_odds(features.values)))
        chance = _chance(log_odds, np.array(drawn))
        if not clear < chance <= hopeless:
            break
    return LookAlikes(chance, len(drawn))


def _look_alikes_of(part: Part, seed: int) -> Iterator[Part]:
    record = part.record
    for pv, op in linear_surrogates(record.pv, record.op, seed):
        yield replace(part, record=replace(record, pv=pv, op=op))


def _chance(value: float, drawn: FloatArray) -> float:
    """That one more draw is at least `value`."""
    count = len(drawn)
    spread = float(np.std(drawn, ddof=1)) * np.sqrt(1.0 + 1.0 / count)
    if spread <= 0.0:
        return float(value <= drawn[0])
    return float(special.stdtr(count - 1, (float(np.mean(drawn)) - value) / spread))
