"""One rival explanation."""

from dataclasses import dataclass

from app.engine.codes import Cause
from app.engine.evidence import Operator


@dataclass(frozen=True)
class Rival:
    """An explanation of the loop's movement, beside stiction.

    cause: a stable code. strength: 0 (nothing speaks for it) to 1; from 0.5 on it stands out.
    counts: log-odds that it takes from stiction where it stands out; 0 where the shapes already say so.
    text: what was seen, in words.
    applies: False where its assumptions do not hold; `text` then says why, and the strength is 0.
    statistic, threshold: what was measured and from where on it speaks for it; None where several were weighed.
    operator: how the statistic then stands to the threshold.
    explained: share of the variance of PV that the fitted explanation gives in free run on cycles that the fit has not
    seen; None where nothing was fitted. Comparable between explanations.
    explained_without_stiction: of stiction, the same by a valve that follows OP; None of all others.
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
