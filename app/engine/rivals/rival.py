"""One rival explanation."""

from dataclasses import dataclass

from app.engine.codes import Cause
from app.engine.evidence import Operator


@dataclass(frozen=True)
class Rival:
    """An explanation of the loop's movement, beside stiction.

    cause: a stable code. strength: 0 (nothing speaks for it) to 1; from 0.5 on it stands out.
    counts: log-odds that it takes from stiction if it stands out; 0 if the shapes account for it already.
    text: what was seen, in words.
    applies: False if its assumptions do not hold; `text` then says why, and the strength is 0.
    statistic, threshold: what was measured, and the value from which it speaks for the rival; None if several were
    weighed.
    operator: how the statistic then compares with the threshold.
    explained: share of the variance of PV that the fitted explanation gives in free run on cycles that the fit has not
    seen; None if nothing was fitted. Comparable between explanations.
    explained_without_stiction: for stiction only, the same with a valve that follows OP; None for all others.
    """

    cause: Cause
    strength: float
    text: str
    counts: float = 0.0
    applies: bool = True
    statistic: float | None = None
    threshold: float | None = None
    explained: float | None = None
    operator: Operator = ">="
    explained_without_stiction: float | None = None

    @property
    def stands_out(self) -> bool:
        return self.strength >= 0.5


def not_evaluated(cause: Cause, because: str) -> Rival:
    """A rival whose assumptions the record does not meet."""
    return Rival(cause, 0.0, f"not evaluated, because {because}", applies=False)
