"""The verdict of the published rule: least RMSE over the valve parameter, reliability by table 2.

An audit takes its reasons alone and tells them beside its own verdict (`verdict.judge`); verdict and probability are
for measuring the rule against that one. Source: B. Srinivasan, T. Spinner, R. Rengaswamy, Ind. Eng. Chem. Res. 2015,
54, 7476-7488, doi 10.1021/acs.iecr.5b00939.
"""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np

from app.counting import counted_times
from app.engine.codes import ReasonCode
from app.engine.evidence import Reason
from app.engine.judgement import Judgement
from app.engine.reference.hammerstein import OneParameterResult
from app.engine.reference.reliability import Reference

READINGS = {
    "high_stiction": "PV has harmonics that OP does not produce (Yper {yper:.3g} %), and the identification finds "
    "stiction; by its table 2 alone it would be reliable",
    "low_no_stiction": "PV has hardly any harmonics that OP does not produce (Yper {yper:.3g} %), and the "
    "identification finds no stiction; by its table 2 alone it would be reliable",
    "high_no_stiction": "PV has harmonics that OP does not produce (Yper {yper:.3g} %), yet the identification finds "
    "no stiction; by its table 2 it would not be reliable, the search space may be too small",
    "low_stiction": "PV has hardly any harmonics that OP does not produce (Yper {yper:.3g} %), yet the identification "
    "finds stiction; by its table 2 it would not be reliable, the search space may be too small",
}

# An uncalibrated rule never claims to be surer than some 2,000 to 1.
LARGEST_LOG_ODDS = 7.6


@dataclass(frozen=True)
class ReferenceVerdictConfig:
    """How the evidence of the published rule becomes a number between 0 and 1. Nothing here is calibrated.

    gain_scale: relative reduction of the RMSE by the valve model that moves the log-odds by one.
    yper_weight: log-odds for a factor e in Yper. yper_pivot_pct: Yper, with both signals at unit standard deviation,
    that speaks neither for nor against.
    """

    gain_scale: float = 0.02
    yper_weight: float = 0.5
    yper_pivot_pct: float = 10.0


def judge(reference: Reference, config: ReferenceVerdictConfig | None = None) -> Judgement:
    """Verdict and reliability by the published rule and table 2, from the last rung of the ladder.

    The rule has no probability. The one given here orders recordings by their evidence: it grows with the relative RMSE
    gain of the valve model (negative where the best d is zero) and with Yper, is above 0.5 with the verdict "stiction"
    and below with "no_stiction", and is not calibrated: 0.9 does not mean nine in ten.

    Misleads where the paper's remarks 4.1 to 4.3 say: disturbances and other nonlinearities raise Yper too, and the
    noise model of a noisy record wins the one-step prediction.
    """
    config = config or ReferenceVerdictConfig()
    stiction = reference.last.stiction
    return Judgement(
        verdict="stiction" if stiction else "no_stiction",
        stiction_probability=_probability(reference, stiction, config),
        reliability="reliable" if reference.reliable else "not_reliable",
        reasons=_reasons(reference),
        likely_cause="stiction" if stiction else None,
    )


def rmse_gain(one: OneParameterResult) -> float:
    """Relative reduction of the RMSE by the best d > 0 against d = 0; negative where no d > 0 is better.

    Refined RMSEs are compared with refined ones, as the rule does, and those of the search only where none are refined.
    """
    refined = np.isfinite(one.rmse_refined)
    curve = one.rmse_refined if np.any(refined & (one.d > 0)) else one.rmse
    still, moving = curve[one.d == 0], curve[(one.d > 0) & np.isfinite(curve)]
    if len(moving) == 0 or len(still) == 0 or not 0.0 < still[0] < np.inf:
        return 0.0
    return 1.0 - float(np.min(moving)) / float(still[0])


def _probability(reference: Reference, stiction: bool, config: ReferenceVerdictConfig) -> float:
    # 0.01 % keeps the logarithm finite; so little is nothing.
    yper = math.log(max(reference.yper.yper_pct, 0.01) / config.yper_pivot_pct)
    log_odds = rmse_gain(reference.last.one) / config.gain_scale + config.yper_weight * yper
    lean = 1.0 / (1.0 + math.exp(-min(max(log_odds, -LARGEST_LOG_ODDS), LARGEST_LOG_ODDS)))
    return 0.5 * (lean + 1.0) if stiction else 0.5 * lean


def _reasons(reference: Reference) -> tuple[Reason, ...]:
    last = reference.last
    reading = READINGS[reference.reading].format(yper=reference.yper.yper_pct)
    reasons = [Reason(cast(ReasonCode, f"yper_{reference.reading}"), reading), _curve_reason(last.one)]
    if last.two is not None and bool(last.two.stiction) != bool(last.one.stiction):
        said = "finds stiction" if last.two.stiction else "finds none"
        reasons.append(Reason("two_parameter_disagrees", f"the two-parameter valve model {said}"))
    if reference.widenings:
        said = "agreement was found" if reference.reliable else "the last one did not agree either"
        times = counted_times(reference.widenings)
        reasons.append(Reason("search_space_widened", f"the search space was widened {times}; {said}"))
    if reference.ending == "not_widened":
        text = "the search space was not widened: the shapes of PV and OP already clear the valve"
        reasons.append(Reason("search_space_not_widened", text))
    if reference.ending == "record_too_short":
        reasons.append(Reason("record_too_short_to_widen", "the record is too short for the next search space"))
    reasons.append(
        Reason("reference_only", "verdict and probability come from the published rule alone and are not calibrated")
    )
    return tuple(reasons)


def _curve_reason(one: OneParameterResult) -> Reason:
    gain = 100.0 * rmse_gain(one)
    if one.stiction:
        text = f"a valve with a stiction band of {one.d_best:.4g} predicts PV {gain:.3g} % better than a free valve"
        return Reason("rmse_least_with_stiction", text)
    text = f"no stiction band predicts PV better: the best one is {-gain:.3g} % worse than a free valve"
    return Reason("rmse_least_without_stiction", text)
