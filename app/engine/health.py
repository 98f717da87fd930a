"""One number for how a loop does, and what it is made of: nothing is taken off without a part that says so."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.engine.codes import UNANSWERED
from app.engine.evidence import in_digits, rising, told_probability
from app.engine.judgement import Judgement
from app.engine.key_figures import KeyFigures
from app.engine.oscillation import Oscillation

WEIGHTS = {"stiction": 40.0, "oscillation": 20.0, "service": 15.0, "saturation": 10.0, "tracking": 10.0, "data": 5.0}
"""What each part can take off at most; together 100. Chosen, not fitted: what costs a plant most weighs most."""

UNSURE = 0.6
"""A verdict that cannot be relied on takes off this share of what a reliable one would."""

NOT_JUDGED = 0.5
"""A valve that could not be judged is neither good nor bad: half is taken off, and the part says why."""

TOO_LITTLE = frozenset({"too_short", "missing_values"})
"""Refusals of records in which too little was measured to say anything of a loop, good or bad."""

UNANSWERED_TEXT = "PV {since}: the valve is stuck, or the transmitter is dead"
"""Whichever it is, nothing controls there: the valve's weight is taken off whole, and that of being in automatic where
the loop is."""

CHANCE_STRENGTH, SURE_STRENGTH = 0.3, 0.6
"""An oscillation counts for nothing up to the first, whole from the second: a healthy loop under a load that wanders
shows a regular one, of strength 0.2 in the middle and up to 0.55, because the best of twelve functions is kept."""

FULL_SATURATION_PCT = 50.0
FULL_ERROR_PCT = 5.0

LONG_AT_EXTREME_PCT = 20.0
"""Where OP's span is not known, resting at its own least or greatest value for so long is taken for a limit."""


@dataclass(frozen=True)
class HealthPart:
    """What one aspect takes off. lost: 0..weight points. text: what was seen."""

    code: str
    weight: float
    lost: float
    text: str


@dataclass(frozen=True)
class Health:
    """100 (nothing to complain about) less what each part takes off. parts: in the order of WEIGHTS.

    value is None where too little was measured for a health: then not_evaluated and each part say why.
    """

    value: float | None
    parts: tuple[HealthPart, ...]
    not_evaluated: str | None = None


def health(judgement: Judgement, figures: KeyFigures, oscillation: Oscillation | None) -> Health:
    """The health of a loop, 0..100, from its verdict, its key figures and its oscillation.

    Stiction counts by its probability, a verdict without reliability for 60 % of it; a valve that could not be judged
    or of which the record shows nothing loses half of the weight, and all of it where PV does not answer OP, whether
    that is a verdict or what keeps from one, and however long it answered before: whichever of stuck valve and dead
    transmitter it is, the loop is not controlled, and being in automatic counts for nothing. Oscillation counts by its
    strength where it is regular and more than chance (CHANCE_STRENGTH); time out of automatic, time of OP at a limit
    (50 % of the time is full; its own extremes where no span is known), mean control error (5 % of PV's span is full)
    and missing samples in proportion. A figure that is not known takes nothing off, and says so; where too few samples
    have PV and OP there is no health at all, only the reason. Misleads where a loop is meant to swing (averaging level
    control) or to be in manual.
    """
    because = _too_little(judgement)
    if because is not None:
        return Health(None, tuple(HealthPart(code, weight, 0.0, because) for code, weight in WEIGHTS.items()), because)
    parts = (
        _stiction(judgement),
        _oscillation(oscillation),
        _service(judgement, figures.service_factor_pct),
        _saturation(figures),
        _tracking(figures),
        _data(figures.good_share_pct),
    )
    return _made_of(parts)


def _too_little(judgement: Judgement) -> str | None:
    """Why there is no health; None where there is one."""
    if judgement.verdict != "not_auditable":
        return None
    told = next((reason.text for reason in judgement.reasons if reason.code in TOO_LITTLE), None)
    return None if told is None else f"not evaluated, because too little was measured: {told}"


def doubted_health(parts: Sequence[HealthPart], probability: float) -> Health:
    """The health of a loop of these parts once its verdict of stiction, of a probability, is not relied on any more."""
    valve = _unsure(probability)
    return _made_of(tuple(valve if part.code == valve.code else part for part in parts))


def _made_of(parts: tuple[HealthPart, ...]) -> Health:
    return Health(round(100.0 - sum(part.lost for part in parts), 1), parts)


def _part(code: str, share: float, text: str) -> HealthPart:
    weight = WEIGHTS[code]
    return HealthPart(code, weight, round(weight * min(max(share, 0.0), 1.0), 1), text)


def _stiction(judgement: Judgement) -> HealthPart:
    probability = judgement.stiction_probability
    if _unanswered(judgement):
        return _part("stiction", 1.0, UNANSWERED_TEXT.format(since=_since(judgement.unanswered_s)))
    if probability is None or judgement.shows_no_valve:
        return _part("stiction", NOT_JUDGED, "the valve could not be judged")
    if judgement.reliability == "reliable":
        return _part("stiction", probability, f"probability of stiction {told_probability(probability)}")
    return _unsure(probability)


def _since(unanswered_s: float | None) -> str:
    return (
        "never answers OP"
        if unanswered_s is None
        else f"has not answered OP for the last {in_digits(unanswered_s / 3600.0, 3)} h"
    )


def _unsure(probability: float) -> HealthPart:
    return _part(
        "stiction", UNSURE * probability, f"probability of stiction {told_probability(probability)}, not reliable"
    )


def _oscillation(oscillation: Oscillation | None) -> HealthPart:
    if oscillation is None:
        return _part("oscillation", 0.0, "oscillation not evaluated")
    period_s = oscillation.period_s
    if not oscillation.regular or period_s is None:
        return _part("oscillation", 0.0, "no regular oscillation")
    strength = oscillation.strength
    if strength <= CHANCE_STRENGTH:
        return _part("oscillation", 0.0, f"no oscillation beyond what noise shows, strength {strength:.2f}")
    told = f"{period_s:.0f}" if period_s >= 10.0 else f"{period_s:.3g}"
    counts = strength * rising(strength, CHANCE_STRENGTH, SURE_STRENGTH)
    return _part("oscillation", counts, f"oscillates with a period of {told} s, strength {strength:.2f}")


def _unanswered(judgement: Judgement) -> bool:
    return judgement.likely_cause == UNANSWERED


def _service(judgement: Judgement, service_pct: float | None) -> HealthPart:
    # A flat PV may be a signal that nobody maintains, where nothing says that a controller works against it.
    if _unanswered(judgement) and (judgement.verdict == "inconclusive" or service_pct):
        return _part("service", 1.0, "in automatic, and nothing is controlled")
    if service_pct is None:
        return _part("service", 0.0, "the mode was not recorded")
    return _part("service", 1.0 - service_pct / 100.0, f"in automatic for {service_pct:.0f} % of the time")


def _saturation(figures: KeyFigures) -> HealthPart:
    at_limit, at_extreme = figures.op_saturation_pct, figures.op_at_extreme_pct
    if at_limit is not None:
        return _part("saturation", at_limit / FULL_SATURATION_PCT, f"OP at a limit for {at_limit:.0f} %")
    if at_extreme is None or at_extreme < LONG_AT_EXTREME_PCT:
        return _part("saturation", 0.0, _unknown("the span of OP is not known", figures))
    text = f"OP at its own least or greatest value for {at_extreme:.0f} % (its span is not known)"
    return _part("saturation", at_extreme / FULL_SATURATION_PCT, text)


def _tracking(figures: KeyFigures) -> HealthPart:
    error_pct = figures.error_abs_mean_pct_of_span
    if error_pct is None:
        because = "no set point was recorded" if figures.error_abs_mean is None else "the span of PV is not known"
        return _part("tracking", 0.0, _unknown(because, figures))
    return _part(
        "tracking", error_pct / FULL_ERROR_PCT, f"mean control error {in_digits(error_pct, 2)} % of the span of PV"
    )


def _unknown(because: str, figures: KeyFigures) -> str:
    """Both are of the time in automatic."""
    return "not evaluated: never in automatic" if figures.service_factor_pct == 0.0 else because


def _data(good_pct: float) -> HealthPart:
    return _part("data", 1.0 - good_pct / 100.0, f"{good_pct:.0f} % of the samples are good")
