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
    other, passed through one lag over the other, and later by what its dead time is longer.
    """
    bent = found.K / given.K * rest
    lags = [(given.tau2, found.tau2), (given.tau3, found.tau3)]
    if given.leak > 0.0:
        lags.append((given.tau, found.tau))
    for was, now in lags:
        if was > 0.0 and now > 0.0 and was != now:
            bent = lag_over_lag(bent, float(np.exp(-ts / was)), float(np.exp(-ts / now)))
    return delay(bent, found.theta - given.theta, ts)


def lag_over_lag(signal: FloatArray, was: float, now: float) -> FloatArray:
    """A signal (N,) that comes of a lag as one with another memory of an interval would have made it, from rest."""
    share = (1.0 - now) / (1.0 - was)
    out: FloatArray = scipy.signal.lfilter(
        [share, -share * was], [1.0, -now], signal, zi=[(now - share * was) * signal[0]]
    )[0]
    return out


def bent_with(base: Fit, rest: FloatArray) -> tuple[Fit, Bent | None]:
    """The refit beside what the given trace holds (N,), as it is with the refitted parameters; as it was, and None,
    where the record does not show that better.
    """
    if not np.any(rest) or base.given.plant.K == 0.0:
        return base, None
    bent = Bent(rest, base.given, base.plant)
    again = fit_linear(bent_record(base.record, bent), base.given)
    return (again, bent) if again.likelihood > base.likelihood else (base, None)


def bent_record(record: Experiment, bent: Bent) -> Experiment:
    return record.resting(bent.along(bent.rest, record.as_sampled.sampling_interval_s))


def bent_without(found: Fit, bent: Bent | None, held: BoolArray) -> Fit:
    """A fit, to be made again without the samples `held` (N,) out, beside what the trace holds as it is changed to the
    parameters that the others show.
    """
    if bent is None:
        return found
    blind = fit_linear(found.record.comparing(found.record.usable & ~held).resting(bent.rest), bent.given)
    return replace(found, record=bent_record(found.record, replace(bent, found=blind.plant)))
