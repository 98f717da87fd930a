"""What of the evidence moved most between two verdicts of a loop."""

from app.services.telling.stored_evidence import Shape, shapes
from app.services.telling.wording import PRIOR_ONLY, codes_in, probability
from app.storage.changes import ChangedRow

LEAST_MOVE = 0.1
"""Of the probability; where it moved less, the verdict's edge is what changed."""


def moved(row: ChangedRow) -> str:
    """ "PV stands still while OP moves, then follows it, for 60 % of the time (8 % before), probability 0.10 -> 0.99";
    empty where a verdict has no measured probability, or it hardly moved."""
    measured = _measured(row)
    if measured is None or abs(measured[1] - measured[0]) < LEAST_MOVE:
        return ""
    of_now = shapes(row.reasons, row.reasons_text, row.extra_json)
    of_before = shapes(row.reasons_before, row.reasons_text_before, row.extra_json_before)
    for_it = {code: shape for code, shape in of_now.items() if _speaks_for(row.verdict, shape)}
    return f"{_seen(for_it, of_before)}{probability_moved(row)}"


def probability_moved(row: ChangedRow) -> str:
    """ "probability 0.48 -> 0.55"; empty where one of the two verdicts has no measured probability."""
    measured = _measured(row)
    return "" if measured is None else "probability " + " -> ".join(map(probability, measured))


def _measured(row: ChangedRow) -> tuple[float, float] | None:
    """Before and now; None where one of the two verdicts has no measured probability."""
    before, now = row.probability_before, row.probability
    prior = PRIOR_ONLY in (*codes_in(row.reasons), *codes_in(row.reasons_before))
    return None if prior or now is None or before is None else (before, now)


def _seen(now: dict[str, Shape], before: dict[str, Shape]) -> str:
    """The shape that both verdicts tell a value of and that moved most, else the loudest of now."""
    both = [(_step(now[code], before[code]), code) for code in now if code in before]
    step, code = max(both, default=(0.0, ""))
    if step > 0.0:
        return f"{now[code].text} ({before[code].figure} before), "
    return f"{next(iter(now.values())).text}, " if now else ""


def _step(now: Shape, before: Shape) -> float:
    """Shares count as they are, so that 8 % and 0.08 weigh alike; nothing where one of them tells no value."""
    return 0.0 if now.value is None or before.value is None else abs(now.value - before.value)


def _speaks_for(verdict: str, shape: Shape) -> bool:
    """Whether a shape is on the side of the verdict: what speaks against it is no news of it."""
    decided = verdict in ("stiction", "no_stiction")
    return not decided or shape.for_stiction is None or shape.for_stiction == (verdict == "stiction")
