"""What a given trace holds beside its linear model belongs to the same process: where the record shows another gain or
other time constants than the given ones, that changes with them.
"""

import numpy as np
import scipy

from app.engine.mismatch.fit.fitting import Fit, fit_linear
from app.engine.mismatch.loop.plant import Plant
from app.engine.recording import FloatArray


def as_refitted(rest: FloatArray, given: Plant, found: Plant, ts: float) -> FloatArray:
    """The rest (N,) of a trace of the given plant, as a plant with the gain and the time constants found would have it:
    multiplied by one gain over the other, and passed through one lag over the other.
    """
    bent = found.K / given.K * rest
    lags = [(given.tau2, found.tau2), (given.tau3, found.tau3)]
    if given.leak > 0.0:
        lags.append((given.tau, found.tau))
    for was, now in lags:
        if was > 0.0 and now > 0.0 and was != now:
            bent = lag_over_lag(bent, float(np.exp(-ts / was)), float(np.exp(-ts / now)))
    return bent


def lag_over_lag(signal: FloatArray, was: float, now: float) -> FloatArray:
    """A signal (N,) that comes of a lag as one with another memory of an interval would have made it, from rest."""
    share = (1.0 - now) / (1.0 - was)
    out: FloatArray = scipy.signal.lfilter(
        [share, -share * was], [1.0, -now], signal, zi=[(now - share * was) * signal[0]]
    )[0]
    return out


def bent_with(base: Fit, rest: FloatArray) -> Fit:
    """The refit beside what the given trace holds (N,), as it is with the refitted parameters; as it was where the
    record does not show that better.
    """
    if not np.any(rest):
        return base
    bent = as_refitted(rest, base.given.plant, base.plant, base.record.as_sampled.sampling_interval_s)
    again = fit_linear(base.record.resting(bent), base.given)
    return again if again.likelihood > base.likelihood else base
