"""What a richer noise model would have explained as well: two poles and two zeros are few, and under feedback OP
carries the noise, so that a block which answers OP may take what the noise model lacks, the more the longer the record.
Source: Ljung, System Identification, 1999, section 13.4 (the bias of direct identification in closed loop is that of
the noise model).
"""

import numpy as np

from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.spikes import innovations
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.noise import RIDGE, autocovariances, autoregression, compared_count

_ORDER = 8
ANSWERING = ("valve", "process")


def taken_by_noise(contender: Contender) -> float:
    """The part of a contender's gain (nat, not below 0) that noise alone would have had, were its model richer by an
    autoregression of the innovations: as both fits stand; of what answers OP beside a given simulation, with all
    numbers fitted again. (Beside a loop of our own that was not measured.)
    """
    as_they_stand = max(predictable(contender.over) - predictable(contender.fit), 0.0)
    if contender.block.place not in ANSWERING or contender.fit.given.own:
        return as_they_stand
    left = contender.fit.beside_richer_noise.likelihood - contender.over.beside_richer_noise.likelihood
    return max(as_they_stand, contender.gain - left)


def noise_takes(found: Fit, over: Fit) -> bool:
    """Whether the parts that a fit has and another has not all answer OP, and do not pay beside richer noise; asked
    beside a given simulation alone, as above.
    """
    beside = [part.block.code for part in over.parts]
    more = [part.block for part in found.parts if part.block.code not in beside]
    if not more or found.given.own or any(block.place not in ANSWERING for block in more):
        return False
    return found.beside_richer_noise.score <= over.beside_richer_noise.score


def predictable(fit: Fit) -> float:
    """The log-likelihood (nat) that an autoregression of _ORDER lags gains over white innovations."""
    e, count = innovations(fit), compared_count(fit.record.usable)
    if count <= 2 * _ORDER:
        return 0.0
    covariances = autocovariances(e, _ORDER)
    left = 1.0 - float(autoregression(covariances) @ covariances[1:]) / float(covariances[0])
    return -0.5 * count * float(np.log(max(left, RIDGE)))
