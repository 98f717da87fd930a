"""Evidence: what was measured, against which threshold, and what follows. Shared by every room of the engine."""

from dataclasses import dataclass
from typing import Literal

from app.engine.codes import CheckCode, EvidenceCode, ReasonCode

Outcome = Literal["pass", "fail", "not_evaluated"]


@dataclass(frozen=True)
class Finding:
    """One check, as a row: statistic, threshold, outcome and the reason in words.

    `statistic` and `threshold` are None where the check could not be evaluated; `text` then says why.
    """

    code: CheckCode
    outcome: Outcome
    text: str
    statistic: float | None = None
    threshold: float | None = None
    unit: str = ""


@dataclass(frozen=True)
class Reason:
    """Why a verdict or a reliability is what it is: a stable code and a sentence for an engineer."""

    code: ReasonCode | EvidenceCode
    text: str
