"""Linear explanations: outside disturbance, tight tuning, set-point following, nothing at all."""

import numpy as np

from app.engine.features import Features
from app.engine.oscillation import Oscillation
from app.engine.recording import UniformRecord
from app.engine.rivals.rival import Rival
from app.engine.sampled import correlation

_PURE_SINE = 0.8
_STRONG_SWING = 0.6
_SINE_FORM = 0.2
_STICTION_EXPLAINS = 0.1
_AGAINST_SINES = 3.0


def disturbance(features: Features, oscillation: Oscillation) -> Rival:
    """OP answers PV in line, and stiction explains PV no better than a linear valve: PV is shaken from outside."""
    in_line = features.named("ccf_even") - features.named("ccf_odd")
    kind = "external_oscillation" if oscillation.regular and oscillation.strength > _STRONG_SWING else "disturbance"
    strength = float(np.clip(in_line, 0.0, 1.0)) * (0.5 if features.named("gain") > 0.3 else 1.0)
    text = "OP follows PV in line, as a controller passes a disturbance on; stiction leaves them in quadrature"
    return Rival(kind, strength, text)


def tight_tuning(features: Features, oscillation: Oscillation) -> Rival:
    """Both signals are pure sines that do not die out: a linear loop at the limit of stability, or shaken by a sine."""
    purity = min(features.named("pv_fundamental"), features.named("op_fundamental"))
    strength = oscillation.strength * float(np.clip((purity - _PURE_SINE) / (1 - _PURE_SINE), 0.0, 1.0))
    text = f"PV and OP are nearly sinusoidal ({100 * purity:.0f} % of the power in the fundamental)"
    # A stuck stem leaves corners in one of the two: half cycles of both that fit a sine are no work of a valve.
    sines = max(features.named("pv_triangle"), features.named("op_triangle")) < _SINE_FORM
    if not sines and features.named("gain") >= _STICTION_EXPLAINS:
        strength *= 0.5
    return Rival("tuning_or_sinusoidal_disturbance", strength, text, _AGAINST_SINES if sines else 0.0)


def set_point(record: UniformRecord) -> Rival:
    """PV and OP follow a set point that moves."""
    if record.sp is None or float(np.ptp(record.sp)) == 0.0:
        return Rival("set_point_following", 0.0, "the set point does not move")
    pv_follows, op_follows = correlation(record.pv, record.sp), correlation(record.op, record.sp)
    strength = pv_follows**2 * op_follows**2
    text = f"PV follows the set point (correlation {pv_follows:.2f}) and so does OP ({abs(op_follows):.2f})"
    return Rival("set_point_following", strength, text)


def quiet(oscillation: Oscillation) -> Rival:
    """Nothing swings: what moves is noise or a slow load."""
    strength = 0.7 - oscillation.strength if not oscillation.regular else 0.4 - oscillation.strength
    text = f"no regular oscillation (strength {oscillation.strength:.2f}, regularity {oscillation.regularity:.2f})"
    return Rival("no_oscillation", float(np.clip(strength, 0.0, 1.0)), text)
