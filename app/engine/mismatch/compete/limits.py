"""Tells limits apart by what passes them: a stop in the valve lets all noise through, an overflow only the sensor's,
a sensor's none.
"""

import numpy as np

from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.noise import compared_samples, whiten
from app.engine.mismatch.fit.windows import active_mask
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.physics import valve_saturation
from app.engine.mismatch.physics.sensor_limit import CODE as SENSOR_LIMIT
from app.engine.mismatch.physics.vessel import OVERFLOW
from app.engine.recording import FloatArray

LIMITS_OF_PV = frozenset((OVERFLOW, SENSOR_LIMIT))
"""One limit of PV is one effect, whichever of these it is called."""
_LIMITED = LIMITS_OF_PV | {valve_saturation.HIGH.code}
_NEARLY_ALWAYS = 0.9
_LEAST_SAMPLES = 25
_MOST = 5.0
_SENSOR_LETS_THROUGH = 0.35
_SENSOR_FAULT = 6.0


def _spread(values: FloatArray) -> float:
    return float(np.median(np.abs(values - np.median(values))) / 0.6745) + 1e-300


def limits_always(fit: Fit, part: Part) -> bool:
    """Whether a limit acts nearly all the time: a signal that never leaves it shows no limit, but that it does not
    answer.
    """
    if part.block.code not in _LIMITED:
        return False
    return bool(np.mean(active_mask(fit, part)[fit.record.usable]) > _NEARLY_ALWAYS)


def limit_bonus(fit: Fit, part: Part) -> float:
    """Log-likelihood (nat) that a limited part earns because the noise is smaller where it acts; negative for a
    sensor that is not.
    """
    if part.block.code not in LIMITS_OF_PV:
        return 0.0
    active, compared = active_mask(fit, part), compared_samples(fit.record.usable)
    inside, outside = active & compared, ~active & compared
    if inside.sum() < _LEAST_SAMPLES or outside.sum() < _LEAST_SAMPLES:
        return 0.0
    e = whiten(fit.residual, fit.record.usable, fit.noise)
    share = _spread(e[inside]) / _spread(e[outside])
    if part.block.code == SENSOR_LIMIT and share > _SENSOR_LETS_THROUGH:
        return -_SENSOR_FAULT
    return float(np.clip(-inside.sum() * np.log(share), 0.0, _MOST)) if share < 1.0 else 0.0
