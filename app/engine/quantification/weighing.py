"""From one-step errors over a grid of valves to the values of S that the record leaves possible."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from app.engine.quantification.config import QuantificationConfig
from app.engine.recording import FloatArray

_FINE = 600
# Where the model fails, S lies around this share of R, within this spread of its logarithm.
_FAILED_SHARE, _FAILED_SPREAD = 0.6, 0.8
_SMALLEST_RESIDUAL = 1e-5


@dataclass(frozen=True, eq=False)
class Weights:
    """The distribution over S / R: values and their cumulative probabilities, (m,).

    evidence: log-likelihood gained by the best sticky valve over the linear one, with samples taken as independent.
    """

    shares: FloatArray
    below: FloatArray
    evidence: float

    def share(self, chance: float) -> float:
        return float(np.interp(chance, self.below, self.shares))


def weigh(
    errors: FloatArray, linear: float, total: float, samples: int, shares: FloatArray, config: QuantificationConfig
) -> Weights:
    """errors: (S, forms) sums of squared one-step errors, He's forms first; linear: the same for a valve that follows
    OP.

    total: sum of squares of PV over the same `samples`. shares: (S,) values of S / R, at equal ratios.
    """
    logs = np.log(shares)
    likelihood = -0.5 * config.evidence_weight * samples * np.log(errors / total + _SMALLEST_RESIDUAL)
    log_weight = likelihood + np.log(_form_chances(config))
    log_weight += (-0.5 * ((logs - np.log(config.usual_share)) / config.usual_spread) ** 2)[:, None]
    weight = np.exp(log_weight - log_weight.max())
    seen = np.linspace(logs[0], logs[-1], _FINE)
    true = seen + _read_low(float(errors.min()) / total, config)
    told = _told(np.log(weight.sum(axis=1) + 1e-300), logs, seen, config)
    return Weights(
        shares=np.exp(true),
        below=_cumulated((1.0 - config.failure_share) * told + config.failure_share * _failed(true)),
        evidence=0.5 * samples * float(np.log((linear + 1e-300) / (errors.min() + 1e-300))),
    )


def _form_chances(config: QuantificationConfig) -> FloatArray:
    he, kano = len(config.he_jumps), len(config.kano_jumps)
    return np.concatenate((np.full(he, config.he_chance / he), np.full(kano, (1.0 - config.he_chance) / kano)))


def _read_low(unpredicted: float, config: QuantificationConfig) -> float:
    """How far the logarithm of S lies above what the samples show. unpredicted: share of PV's variance.

    Noise takes OP past its recorded turning points at scans between the samples; the stem slips there, and by the
    samples alone less of OP's way was needed.
    """
    return config.unseen * min(float(np.sqrt(unpredicted)), config.most_noise)


def _told(log_weight: FloatArray, logs: FloatArray, fine: FloatArray, config: QuantificationConfig) -> FloatArray:
    """Chances over `fine` (m,) where the model holds, blurred by what it is off by."""
    dense = np.interp(fine, logs, log_weight)
    told = gaussian_filter1d(np.exp(dense - dense.max()), config.discrepancy / (fine[1] - fine[0]), mode="constant")
    return np.asarray(told / told.sum())


def _failed(fine: FloatArray) -> FloatArray:
    """Chances over `fine` (m,) where it fails."""
    failed = np.exp(-0.5 * ((fine - np.log(_FAILED_SHARE)) / _FAILED_SPREAD) ** 2)
    return np.asarray(failed / failed.sum())


def _cumulated(chances: FloatArray) -> FloatArray:
    below = np.cumsum(chances)
    return (below - 0.5 * chances) / below[-1]
