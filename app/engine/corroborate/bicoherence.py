"""Choudhury's higher-order statistics: phase coupling in the control error, that is a nonlinearity in the loop."""

from dataclasses import dataclass

import numpy as np
from scipy import fft

from app.engine.corroborate.case import Case
from app.engine.corroborate.chance_coupling import FIRST, SECOND, SEGMENT, chance_limit
from app.engine.corroborate.corroboration import Corroboration, Method, Says
from app.engine.recording import FloatArray
from app.engine.signals.sampled import block_means, hann, unlike, without_drift

METHOD = Method(
    "bicoherence",
    threshold=1e-3,
    source="Choudhury, Shah, Thornhill 2004, Automatica 40, 1719-1728",
    doi="10.1016/j.automatica.2004.03.022",
)
_NLI_FROM = 0.01
_SAMPLES_A_CYCLE = 32
_FEWEST_SEGMENTS = 8
_LONGEST = 8192
# Where hardly any power is, the bicoherence is a quotient of roundings: below this share of the largest it is left out.
_NO_POWER = 1e-3
_GOLDEN = 0.618


@dataclass(frozen=True)
class NonlinearityIndices:
    """ngi: above 0.001 not Gaussian. nli: above 0.01 not linear, where it is not Gaussian."""

    ngi: float
    nli: float


def bicoherence(case: Case) -> Corroboration:
    """NGI, and NLI where NGI is above 0.001: phase coupling between lines of the spectrum of the control error.

    For any loop with enough data, oscillating or not. Stiction where NGI > 0.001 and NLI > 0.01, else none: what it
    finds is a nonlinearity somewhere in the loop, the valve being the usual one. Sampling is thinned to 32 to 64
    samples a cycle, so that segments of 64 hold one or two cycles. Misleads where both halves of the cycle are alike:
    such a wave has no even harmonics and no bispectrum; and where a disturbance is skewed.
    """
    x, per_cycle = _error(case)
    segments = 2 * len(x) // SEGMENT - 1
    if segments < _FEWEST_SEGMENTS:
        return METHOD.refuse(f"{max(segments, 0)} segments of {SEGMENT} samples, needed {_FEWEST_SEGMENTS}")
    if np.std(x) <= 1e-9 * np.max(np.abs(case.record.pv)):
        return METHOD.refuse("the control error does not vary")
    # Fourth powers of what a plant may send as a unit would leave the range of numbers.
    indices = nonlinearity_indices(x / np.std(x), _hop(per_cycle))
    says: Says = "stiction" if indices.ngi > METHOD.threshold and indices.nli > _NLI_FROM else "no_stiction"
    return METHOD.decided(indices.ngi, says, f"NGI of the control error, NLI = {indices.nli:.2g}")


def nonlinearity_indices(x: FloatArray, hop: int = SEGMENT // 2) -> NonlinearityIndices:
    """NGI = mean of bic^2 less its 95 % limit for Gaussian noise; NLI = largest bic^2 less (mean + 2 deviations).

    x: (n,) more than a segment. hop: samples from one segment of 64 to the next, each under a Hann window. The source's
    limit, (1.645 + sqrt(4 L - 1))^2 / (4 K L) of K segments and L pairs of lines, takes the pairs as independent; under
    a window they are not, and white noise exceeds it in 17 to 26 % of records. Here it is that of `chance_limit`.
    NLI has none: white noise of up to some 200 segments nearly always has more than 0.01, so that NGI decides.
    """
    starts = np.arange(0, len(x) - SEGMENT + 1, hop)
    pieces = x[starts[:, None] + np.arange(SEGMENT)]
    lines = fft.rfft((pieces - pieces.mean(axis=1, keepdims=True)) * hann(SEGMENT), axis=1)
    pairs, sums = lines[:, FIRST] * lines[:, SECOND], lines[:, FIRST + SECOND]
    power = np.mean(np.abs(pairs) ** 2, axis=0) * np.mean(np.abs(sums) ** 2, axis=0)
    coupled = np.abs(np.mean(pairs * np.conj(sums), axis=0)) ** 2
    strong = power > _NO_POWER * power.max()
    squared = coupled[strong] / power[strong]
    mean, spread = float(np.mean(squared)), float(np.std(squared))
    return NonlinearityIndices(
        mean - chance_limit(strong, len(starts), hop), float(squared.max()) - mean - 2.0 * spread
    )


def _hop(per_cycle: float) -> int:
    """About half a segment, but no whole number of cycles: segments in step with a sine would find it coupled."""
    hops = (np.arange(SEGMENT) + _GOLDEN) * max(per_cycle, 1.0)
    return max(1, round(float(hops[np.argmin(np.abs(hops - SEGMENT // 2))])))


def _error(case: Case) -> tuple[FloatArray, float]:
    """The control error (PV where SP was not recorded), thinned, without drift, its newest part; samples a cycle."""
    record, per_cycle = case.record, case.oscillation.samples_per_cycle or 0.0
    error = record.pv if record.sp is None else unlike(record.pv, record.sp)
    stride = max(1, int(per_cycle / _SAMPLES_A_CYCLE))
    return without_drift(block_means(error[-_LONGEST * stride :], stride), 2 * SEGMENT), per_cycle / stride
