"""Explanations for people: which of them are worth a look, and why one comes first although another scored higher."""

from collections.abc import Mapping, Sequence
from typing import Any

from app.services.telling.wording import cause_words

STICTION = "stiction"
LEFT = (
    "its score is what is left of the probability once the other causes' evidence against it is taken off; the other "
    "scores say how clearly each was seen, and all of them can be seen on a sticky loop too."
)
NEAREST = (
    "all of them stand out (a score of 0.50 or more), and then the cause nearest to the loop's own instruments wins, "
    "because it can bring about what the farther ones show and not the other way round."
)

LEAST_SCORE = 0.1
"""Below it nothing was seen that an engineer would weigh."""

Told = Mapping[str, Any]


def worth_a_look(rivals: Sequence[Told]) -> tuple[list[Told], list[Told]]:
    """The explanations that anything speaks for, the first one in any case, and the others."""
    seen = [k == 0 or (rival["applies"] and rival["score"] >= LEAST_SCORE) for k, rival in enumerate(rivals)]
    apart = list(zip(rivals, seen, strict=True))
    return [rival for rival, kept in apart if kept], [rival for rival, kept in apart if not kept]


def why_first(rivals: Sequence[Told], winner: str | None) -> str | None:
    """None where nothing needs to be said. `rivals`: the explanations as a verdict's detail has them, ranked."""
    first = next((rival for rival in rivals if rival["code"] == winner), None)
    if first is None:
        return None
    above = [rival for rival in rivals if rival["applies"] and rival["score"] > first["score"]]
    if not above:
        return None
    names = _listed([f"“{cause_words(rival['code'])}”" for rival in above])
    return f"“{cause_words(winner)}” wins although {names} scored higher: {LEFT if winner == STICTION else NEAREST}"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
