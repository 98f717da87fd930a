"""What a given trace holds beside its linear model belongs to the same process: where the record shows another gain,
other time constants or another dead time than the given ones, that changes with them.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from app.engine.mismatch.fit.fitting import Fit, fit_linear
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.plant import Plant, delay
from app.engine.recording import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Bent:
    """What a trace holds beside the given linear model (rest, (N,), as it came), changed to that of the plant found."""

    rest: FloatArray
    given: Given
    found: Plant

    def along(self, rest: FloatArray, ts: float) -> FloatArray:
        """What a trace of the same simulation holds (N,), changed alike."""
        return as_refitted(rest, self.given.plant, self.found, ts)


def as_refitted(rest: FloatArray, given: Plant, found: Plant, ts: float) -> FloatArray:
    """The rest (N,) of a trace of the given plant, as the plant found would have it: multiplied by one gain over the
    other, passed through one lag, or one swing, over the other, and later by what its dead time is longer.
    """
    bent = found.K / given.K * rest
    for was, now in zip(_memories(given, ts), _memories(found, ts), strict=True):
        if not np.array_equal(was, now):
            bent = _one_over_other(bent, was, now)
    return delay(bent, found.theta - given.theta, ts)


def _memories(plant: Plant, ts: float) -> list[FloatArray]:
    """The polynomials (2,) or (3,) in the delay by an interval of each lag, and of the swing, of a plant."""
    swings = plant.leak > 0.0 and plant.damping > 0.0
    first = plant.tau if plant.leak > 0.0 and not swings else 0.0
    lags = [np.array([1.0, -np.exp(-ts / tau)]) for tau in (plant.tau2, plant.tau3, first) if tau > 0.0]
    if not swings:
        return lags
    poles = np.roots([plant.tau**2, 2.0 * plant.damping * plant.tau, 1.0])
    return [*lags, np.real(np.poly(np.exp(ts * poles)))]


def _one_over_other(signal: FloatArray, was: FloatArray, now: FloatArray) -> FloatArray:
    """A signal (N,) that comes of one memory as another would have made it, from rest."""
    share = np.sum(now) / np.sum(was) * was
    begun = scipy.signal.lfilter_zi(share, now) * signal[0]
    out: FloatArray = scipy.signal.lfilter(share, now, signal, zi=begun)[0]
    return out


def bent_with(base: Fit, rest: FloatArray) -> tuple[Fit, Bent | None]:
    """The refit beside what the given trace holds (N,), as it is with the refitted parameters; as it was, and None,
    where the record does not show that better.
    """
    if not np.any(rest) or base.given.plant.K == 0.0:
        return base, None
    bent = Bent(rest, base.given, base.plant)
    again = fit_linear(_bent_record(base.record, bent), base.given)
    return (again, bent) if again.likelihood > base.likelihood else (base, None)


def _bent_record(record: Experiment, bent: Bent) -> Experiment:
    return record.resting(bent.along(bent.rest, record.as_sampled.sampling_interval_s))


def bent_without(found: Fit, bent: Bent | None, held: BoolArray) -> Fit:
    """A fit, to be made again without the samples `held` (N,) out, beside what the trace holds as it is changed to the
    parameters that the others show.
    """
    if bent is None:
        return found
    blind = fit_linear(found.record.comparing(found.record.usable & ~held).resting(bent.rest), bent.given)
    return replace(found, record=_bent_record(found.record, replace(bent, found=blind.plant)))
