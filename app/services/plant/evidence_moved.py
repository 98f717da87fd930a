"""What of the evidence moved most between two verdicts of a loop."""

import re
from typing import Any

from app.services.wording import PRIOR_ONLY, probability

LEAST_MOVE = 0.1
"""Of the probability; where it moved less, the verdict's edge is what changed."""

SHAPE = "shape_"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?: %)?")


def moved(row: Any) -> str:
    """ "PV stands while OP moves, and then follows it, for 60 % of the time (8 % before), probability 0.10 -> 0.99";
    empty where a verdict has no measured probability, or it hardly moved. row: what `plant.changes` tells."""
    now, before = row.probability, row.probability_before
    prior = PRIOR_ONLY in f"{row.reasons};{row.reasons_before or ''}".split(";")
    if prior or now is None or before is None or abs(now - before) < LEAST_MOVE:
        return ""
    seen = _seen(_shapes(row.reasons, row.reasons_text), _shapes(row.reasons_before, row.reasons_text_before))
    return f"{seen}probability {probability(before)} -> {probability(now)}"


def hardly_moved(row: Any) -> str:
    """ "probability 0.48 -> 0.55", of a verdict whose evidence is about the same; empty where it has no measured
    probability."""
    now, before = row.probability, row.probability_before
    prior = PRIOR_ONLY in f"{row.reasons};{row.reasons_before or ''}".split(";")
    return "" if prior or now is None or before is None else f"probability {probability(before)} -> {probability(now)}"


def _shapes(codes: str | None, text: str | None) -> dict[str, str]:
    """What a verdict says of shapes, by code, the loudest first; nothing where its sentences cannot be told apart."""
    named, told = (codes or "").split(";"), (text or "").split(". ")
    found = zip(named, told, strict=True) if len(named) == len(told) else ()
    return {code: sentence for code, sentence in found if code.startswith(SHAPE)}


def _seen(now: dict[str, str], before: dict[str, str]) -> str:
    """The shape that both verdicts tell of and that moved most, else the loudest of now."""
    both = [(abs(_value(now[code]) - _value(before[code])), code) for code in now if code in before]
    if both and max(both)[0] > 0.0:
        code = max(both)[1]
        return f"{now[code]} ({_number(before[code])} before), "
    return f"{next(iter(now.values()))}, " if now else ""


def _number(sentence: str) -> str:
    found = NUMBER.search(sentence)
    return found[0] if found else "?"


def _value(sentence: str) -> float:
    """Shares count as they are, so that 8 % and 0.08 weigh alike; nothing where there is no number."""
    found = NUMBER.search(sentence)
    if found is None:
        return 0.0
    return float(found[0].removesuffix(" %")) / (100.0 if found[0].endswith("%") else 1.0)
