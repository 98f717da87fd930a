"""What one published method says of one loop, and whether it applies at all."""

from dataclasses import dataclass
from typing import Literal

Says = Literal["stiction", "no_stiction"]


@dataclass(frozen=True)
class Corroboration:
    """One method's answer.

    applies: whether the method's own assumptions hold; why_not says which one does not, and is "" where they all do.
    statistic: None where the method does not apply. threshold: above it the method says stiction.
    says: None where the method does not apply, and where its source leaves a band in which it does not decide.
    text: a sentence for an engineer. source: where it was published; doi: None where it could not be checked.
    """

    method: str
    applies: bool
    why_not: str
    statistic: float | None
    threshold: float
    says: Says | None
    text: str
    source: str
    doi: str | None


@dataclass(frozen=True)
class Method:
    """A method's name, source and thresholds.

    threshold: above it the method says stiction. lower: at or below it no stiction; None: there is no band between.
    """

    name: str
    threshold: float
    source: str
    doi: str | None = None
    lower: float | None = None

    def refuse(self, why: str) -> Corroboration:
        return Corroboration(
            self.name, False, why, None, self.threshold, None, f"does not apply: {why}", self.source, self.doi
        )

    def answer(self, statistic: float, what: str) -> Corroboration:
        """The statistic against the thresholds."""
        return self.decided(statistic, self._says(statistic), what)

    def decided(self, statistic: float, says: Says | None, what: str) -> Corroboration:
        """An answer where more than the statistic decides."""
        text = f"{what}: {statistic:.3g} against {self.threshold:.3g}, {_WORDS[says]}"
        return Corroboration(self.name, True, "", statistic, self.threshold, says, text, self.source, self.doi)

    def _says(self, statistic: float) -> Says | None:
        if statistic > self.threshold:
            return "stiction"
        lower = self.threshold if self.lower is None else self.lower
        return "no_stiction" if statistic <= lower else None


_WORDS: dict[Says | None, str] = {"stiction": "stiction", "no_stiction": "no stiction", None: "undecided"}
