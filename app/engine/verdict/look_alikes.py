"""Whether a linear loop under a Gaussian load would look as sticky: the record beside its linear surrogates."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy import special

from app.engine.features import Features, Part, cycle_samples, observe_parts, parts_of, spans
from app.engine.features.window import MOST_WINDOWS
from app.engine.oscillation import Oscillation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.surrogates import kept_step, linear_surrogates
from app.engine.verdict.shape_model import ShapeModel

MOST_CHANCE = 0.02
"""Above it, stiction is not told from a linear loop."""

_STAGES = ((5, 0.004, 0.3), (10, 0.01, 0.15), (19, MOST_CHANCE, MOST_CHANCE))
"""After so many surrogates of one window, or as many of several as tell as much, it is enough where the chance is below
the first bound or above the second; most records that stick need the first."""

# Where PV or OP keep step from one window to the next by more than this, the second says what the first has said.
_MOST_IN_STEP = 0.5


@dataclass(frozen=True)
class LookAlikes:
    """chance: the probability that a linear surrogate of the record looks at least as sticky as the record does.

    surrogates: how many were computed.
    """

    chance: float
    surrogates: int

    @property
    def shown(self) -> bool:
        """Whether the record is shown to be stickier than a linear loop with its spectra."""
        return self.chance <= MOST_CHANCE


def look_alikes(record: UniformRecord, oscillation: Oscillation, log_odds: float, model: ShapeModel) -> LookAlikes:
    """The probability that a linear loop with the spectra of the record has these log-odds of its shapes, or higher
    ones.

    It is Student's t for one more draw from a normal population of which a few draws are known. The windows of a linear
    record count independently if they share no samples, and no line of the spectrum keeps step from one to the next.
    Then each window of a surrogate is combined with each of the others', W windows give W times the degrees of freedom,
    and fewer surrogates are drawn, as many as reach as far as those of one window. (Of 220 records that were tested, 15
    have such windows: the log-odds of windows from different surrogates had 1.00 to 1.04 times the variance of those
    from one, and 1.29 times where windows share samples. Of 120 linear records of exactly 50 cycles, whose windows keep
    step, 29 were taken for more than linear before that was tested, and 5 are now.)

    If the shapes are those of the whole record and of the stretch with the set point at rest, each of the two has
    surrogates of its own: those of the whole have lost what goes with the set point, by which that stretch is found.
    Log-odds are not quite normal, and testing in three stages is not testing once: of 6,600 linear records, 2.2 % had a
    chance of MOST_CHANCE or less, not 2 %.

    Misleads: what is not linear although no valve sticks (corners from elsewhere, a sensor that moves in steps, OP at
    its limit) is not told from stiction. The rivals test for that.
    """
    parts = parts_of(record, oscillation)
    alike = zip(*(_look_alikes_of(part, seed) for seed, part in enumerate(parts)), strict=True)
    in_step = any(_in_step(part) for part in parts)
    drawn: list[Features] = []
    chance = 1.0
    for of_one_window, clear, hopeless in _STAGES:
        while len(drawn) < _needed(of_one_window, clear, drawn):
            features = observe_parts(next(alike))
            if features is None:
                return LookAlikes(1.0, len(drawn))
            # Windows that keep step tell as little beside each other as those that share samples.
            drawn.append(replace(features, overlap=features.overlap or in_step))
        chance = _chance(log_odds, drawn, model)
        if not clear < chance <= hopeless:
            break
    return LookAlikes(chance, len(drawn))


def _look_alikes_of(part: Part, seed: int) -> Iterator[Part]:
    record = part.record
    for pv, op in linear_surrogates(record.pv, record.op, seed):
        yield replace(part, record=replace(record, pv=pv, op=op))


def _in_step(part: Part) -> bool:
    """Whether the windows of a surrogate repeat each other, as those of a load that is strictly periodic do."""
    record, per_cycle = part.record, cycle_samples(part.record, part.oscillation)
    _, *later = (span.start for span in spans(record, per_cycle, MOST_WINDOWS))
    kept = (kept_step(x, later, 2.0 * per_cycle, per_cycle / 4.0) for x in (record.pv, record.op))
    return bool(later) and any(np.any(steps > _MOST_IN_STEP) for steps in kept)


def _needed(of_one_window: int, chance: float, drawn: Sequence[Features]) -> int:
    """Surrogates by which what has this chance stands out as soon as by so many of one window; of a number with which
    every two windows meet.
    """
    if not drawn:
        return 1
    each, reach, needed = _freedom_each(drawn), _reach(of_one_window, 1.0, chance), 2
    while _reach(needed, each, chance) > reach or math.gcd(needed, math.factorial(_apart(drawn) - 1)) > 1:
        needed += 1
    return needed


@lru_cache(maxsize=256)  # at each draw it is asked of the same few numbers
def _reach(count: int, freedom_each: float, chance: float) -> float:
    """Standard deviations above the mean of so many surrogates from which on one more has at most this chance."""
    return -float(special.stdtrit((count - 1) * freedom_each, chance)) * math.sqrt(1.0 + 1.0 / count)


def _freedom_each(drawn: Sequence[Features]) -> float:
    """Degrees of freedom that a further surrogate adds, by Welch and Satterthwaite."""
    if _apart(drawn) == 1:
        return 1.0
    weights = drawn[0].weights
    return float(np.sum(weights**2) ** 2 / np.sum(weights**4))


def _apart(drawn: Sequence[Features]) -> int:
    """Windows of a surrogate that tell of it independently."""
    weights = drawn[0].weights
    alike = len({features.weights.tobytes() for features in drawn}) == 1
    return len(weights) if alike and not any(features.overlap for features in drawn) else 1


def _chance(value: float, drawn: Sequence[Features], model: ShapeModel) -> float:
    """That one more draw is at least `value`."""
    count = len(drawn)
    log_odds = model.log_odds(_recombined(drawn))
    # Over the recombined ones the spread of each window is that of `count` draws, however often each comes.
    spread = float(np.std(log_odds)) * math.sqrt(count / (count - 1) * (1.0 + 1.0 / count))
    if spread <= 0.0:
        return float(value <= log_odds[0])
    freedom = (count - 1) * _freedom_each(drawn)
    return float(special.stdtr(freedom, (float(np.mean(log_odds)) - value) / spread))


def _recombined(drawn: Sequence[Features]) -> FloatArray:
    """(K, F) features of surrogates; where their windows are apart, of every two windows each with each of the others
    once.
    """
    count, apart = len(drawn), _apart(drawn)
    if apart == 1:
        return np.array([features.values for features in drawn])
    tables = np.array([features.table for features in drawn])
    first, step = np.divmod(np.arange(count**2), count)
    of = (first[:, None] + step[:, None] * np.arange(apart)) % count
    return np.einsum("w,kwf->kf", drawn[0].weights, tables[of, np.arange(apart)])
