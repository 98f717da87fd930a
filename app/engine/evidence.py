"""Evidence: what was measured, against which threshold, and what follows. Shared by every room of the engine."""

from collections.abc import Callable
from dataclasses import dataclass
from operator import ge, gt, le, lt
from typing import Literal

from app.engine.codes import CheckCode, EvidenceCode, ReasonCode

Outcome = Literal["pass", "fail", "not_evaluated"]
Operator = Literal["<", "<=", ">", ">="]

_HOLDS: dict[Operator, Callable[[float, float], bool]] = {"<": lt, "<=": le, ">": gt, ">=": ge}


@dataclass(frozen=True)
class Measured:
    """What a reason rests on, as data: its sentence tells people the same, and nobody reads numbers out of it."""

    statistic: float
    operator: Operator
    threshold: float

    @property
    def passed(self) -> bool:
        """Whether `statistic operator threshold` holds."""
        return _HOLDS[self.operator](self.statistic, self.threshold)


def rising(value: float, low: float, high: float) -> float:
    """0 where value is at or below `low`, 1 from `high` on, 0.5 half way; with low > high it falls instead."""
    return min(max((value - low) / (high - low), 0.0), 1.0)


def told_probability(value: float) -> str:
    """A probability, 0 to 1, as all that people read tells it: two digits, and never certain. 0.9956 is not 1.00."""
    return "over 0.99" if value >= 0.995 else "under 0.01" if value < 0.005 else f"{value:.2f}"


def in_digits(value: float, digits: int) -> str:
    """A number with so many significant digits, but no exponent where it is large: 1.2e+02 h is read by nobody."""
    return f"{value:.0f}" if abs(value) >= 10.0**digits - 0.5 else f"{value:.{digits}g}"


def measured_of(statistic: float | None, operator: Operator | None, threshold: float | None) -> Measured | None:
    """None where one of them is not known: nothing was held against anything."""
    if statistic is None or operator is None or threshold is None:
        return None
    return Measured(statistic, operator, threshold)


@dataclass(frozen=True)
class Finding:
    """One check, as a row: statistic, threshold, outcome and the reason in words.

    `statistic` and `threshold` are None where the check could not be evaluated; `text` then says why.
    `operator` is how the statistic stands to the threshold where the check passes; None where more is weighed.
    """

    code: CheckCode
    outcome: Outcome
    text: str
    statistic: float | None = None
    threshold: float | None = None
    unit: str = ""
    operator: Operator | None = None


@dataclass(frozen=True)
class Reason:
    """Why a verdict or a reliability is what it is: a stable code and a sentence for an engineer.

    `measured` is None where no single figure was held against a threshold.
    """

    code: ReasonCode | EvidenceCode
    text: str
    measured: Measured | None = None


def reason_of(finding: Finding) -> Reason:
    """A finding as a reason: same code, same sentence, same figures."""
    return Reason(finding.code, finding.text, measured_of(finding.statistic, finding.operator, finding.threshold))
