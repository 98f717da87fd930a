"""What one published method says, and whether it applies."""

from dataclasses import dataclass
from typing import Literal

Says = Literal["stiction", "no_stiction", "undecided", "not_applicable"]


@dataclass(frozen=True)
class Corroboration:
    """One method's answer. statistic: None where the method does not apply; text says why, or what was found."""

    method: str
    says: Says
    statistic: float | None
    threshold: float
    text: str
    doi: str


@dataclass(frozen=True)
class Method:
    """A method with its source and the statistic between two thresholds at which it does not decide.

    sticky_from: from this statistic on it says stiction; healthy_to: up to this one no stiction.
    """

    name: str
    doi: str
    sticky_from: float
    healthy_to: float

    def answer(self, statistic: float, what: str) -> Corroboration:
        says: Says = "undecided"
        if statistic >= self.sticky_from:
            says = "stiction"
        elif statistic <= self.healthy_to:
            says = "no_stiction"
        text = f"{what}: {statistic:.3g} (stiction from {self.sticky_from:g}, none up to {self.healthy_to:g})"
        return Corroboration(self.name, says, statistic, self.sticky_from, text, self.doi)

    def refuse(self, why: str) -> Corroboration:
        return Corroboration(self.name, "not_applicable", None, self.sticky_from, f"does not apply: {why}", self.doi)
