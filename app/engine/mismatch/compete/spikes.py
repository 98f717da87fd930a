"""What single samples say: noise with heavy tails has spikes, and a block that fits a spike has explained nothing."""

import numpy as np

from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.noise import compared_samples, settling_samples, whiten
from app.engine.recording import BoolArray, FloatArray

_SPIKES = 4
_FAR = 4.2
_PENALTY_A_SPIKE, _MOST = 3.0, 25.0


def innovations(fit: Fit) -> FloatArray:
    """Innovations over their standard deviation, (N - settling,) without those that `settling_samples` counts; zero
    where there is none.
    """
    e = whiten(fit.residual, fit.record.usable, fit.noise)
    return e[settling_samples(fit.record.samples) :] / fit.noise.deviation


def _compared(fit: Fit) -> BoolArray:
    """(N - settling,) True where `innovations` has one."""
    return compared_samples(fit.record.usable)[settling_samples(fit.record.samples) :]


def steady_gain(contender: Contender) -> float:
    """The gain (nat) of a contender without the samples that give most of it."""
    before, after = innovations(contender.over), innovations(contender.fit)
    each = 0.5 * (before**2 - after**2)
    return contender.gain - float(np.sum(np.sort(each)[-_SPIKES:]))


def tail_penalty(fit: Fit) -> float:
    """What a jump must gain more (nat) where the noise jumps by itself: by the count of innovations far out."""
    e = innovations(fit)[_compared(fit)]
    if len(e) == 0:
        return 0.0
    scale = float(np.median(np.abs(e)) / 0.6745) + 1e-300
    return min(_PENALTY_A_SPIKE * float(np.sum(np.abs(e) > _FAR * scale)), _MOST)
