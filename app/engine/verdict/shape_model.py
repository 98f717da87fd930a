"""The model that combines the features: a monotone logistic and a small network, both plain numbers in `parameters`.

The networks learned from simulated loops and recordings together, the logistic from recordings alone. The sign of every
weight of the logistic was fixed by physics beforehand (OP and PV in quadrature can only speak for stiction, and so on).
Their mean log-odds are calibrated on valves that neither had seen.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from app.engine.features import NAMES
from app.engine.recording import FloatArray
from app.engine.verdict import parameters as fitted


@dataclass(frozen=True, eq=False)
class ShapeModel:
    """The fitted numbers. F features, H hidden units, K networks.

    centre, scale: (F,) standardisation; `clip` bounds what one feature can say, in standard deviations.
    slope: (F,) weights of the logistic on standardised features; intercept: its constant.
    hidden: (K, F, H), hidden_bias: (K, H), out: (K, H), out_bias: (K,) of the networks, tanh units.
    calibration: (slope, intercept) from raw to calibrated log-odds.
    """

    centre: FloatArray
    scale: FloatArray
    clip: float
    slope: FloatArray
    intercept: float
    hidden: FloatArray
    hidden_bias: FloatArray
    out: FloatArray
    out_bias: FloatArray
    calibration: tuple[float, float]

    def standard(self, values: FloatArray) -> FloatArray:
        """Standardised, clipped features; values (..., F)."""
        return np.clip((values - self.centre) / self.scale, -self.clip, self.clip)

    def logistic_part(self, values: FloatArray) -> FloatArray:
        return self.intercept + self.standard(values) @ self.slope

    def network_part(self, values: FloatArray) -> FloatArray:
        z = self.standard(values)
        answers = [
            np.tanh(z @ self.hidden[k] + self.hidden_bias[k]) @ self.out[k] + self.out_bias[k]
            for k in range(len(self.out))
        ]
        return np.mean(answers, axis=0)

    def raw_log_odds(self, values: FloatArray) -> FloatArray:
        """Log-odds of stiction before calibration, (...,), for feature values (..., F)."""
        return 0.5 * (self.logistic_part(values) + self.network_part(values))

    def log_odds(self, values: FloatArray) -> FloatArray:
        """Calibrated log-odds of stiction, (...,), for feature values (..., F)."""
        slope, intercept = self.calibration
        return slope * self.raw_log_odds(values) + intercept

    def contributions(self, values: FloatArray) -> FloatArray:
        """(F,) what each feature adds to the log-odds of the logistic: its reasons, not the network's."""
        return self.standard(values) * self.slope


@lru_cache(maxsize=1)
def fitted_model() -> ShapeModel:
    """The model that this version ships, made once. Raises ValueError where its features are not those we have."""
    if fitted.FEATURES != NAMES:
        raise ValueError("the verdict's parameters were fitted to other features; run `make evaluate` to fit them anew")
    return ShapeModel(
        centre=np.array(fitted.CENTRE),
        scale=np.array(fitted.SCALE),
        clip=fitted.CLIP,
        slope=np.array(fitted.SLOPE),
        intercept=fitted.INTERCEPT,
        hidden=np.array(fitted.HIDDEN).reshape(fitted.NETWORKS, len(NAMES), -1),
        hidden_bias=np.array(fitted.HIDDEN_BIAS).reshape(fitted.NETWORKS, -1),
        out=np.array(fitted.OUT).reshape(fitted.NETWORKS, -1),
        out_bias=np.array(fitted.OUT_BIAS),
        calibration=fitted.CALIBRATION,
    )
