"""Verdicts heard beside those of other loops: of loops that swing in step one shakes the others, and a valve that is
accused for its neighbour's sake is not relied on; a loop whose OP is the set point of another one moves no valve.
"""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from app.engine.cascades import Cascade, cascades
from app.engine.excerpts import Excerpts
from app.engine.health import HealthPart, doubted_health
from app.engine.plant_wide import Candidate, Group, Suspect, groups
from app.services.wording import RELIABILITY_BRIEF, VERDICT_WORDS

SHAKEN_BY_NEIGHBOUR = "shaken_by_neighbour"
MOVES_SET_POINT = "moves_set_point"


@dataclass(frozen=True)
class Said:
    """What a loop's own record says. stiction_probability: None where it is not auditable."""

    verdict: str
    reliability: str
    stiction_probability: float | None

    @property
    def relied_on(self) -> bool:
        return self.reliability == "reliable"

    @property
    def accused(self) -> bool:
        return self.relied_on and self.verdict == "stiction"

    @property
    def cleared(self) -> bool:
        return self.relied_on and self.verdict == "no_stiction"


@dataclass(frozen=True)
class Doubt:
    """What other loops tell of a verdict: the reason, as it stands first, for which nobody should rely on it."""

    code: str
    text: str


def all_doubts(
    said: Mapping[str, Said], candidates: Sequence[Candidate], excerpts: Mapping[str, Excerpts]
) -> dict[str, Doubt]:
    """The doubts by tag. candidates: the loops that swing. excerpts: those of which OP or SP moves."""
    found = cascades(excerpts)
    accused = {tag for tag, one in said.items() if one.accused}
    shaken = neighbours_doubts(groups(without_outer(candidates, found)), accused) if accused else {}
    doubted = {tag: replace(said[tag], reliability="not_reliable") for tag in shaken}
    return shaken | cascades_doubts(found, {**said, **doubted})


def without_outer(candidates: Iterable[Candidate], found: Iterable[Cascade]) -> list[Candidate]:
    """The candidates, of which those that move no valve are no source: their probability is left out."""
    outer = {cascade.outer for cascade in found}
    return [replace(one, stiction_probability=None) if one.tag in outer else one for one in candidates]


def neighbours_doubts(together: Iterable[Group], accused: Container[str]) -> dict[str, Doubt]:
    """accused: tags of the loops whose valves are reliably said to stick."""
    return {
        suspect.tag: Doubt(SHAKEN_BY_NEIGHBOUR, neighbour_text(suspect, group.suspects[0]))
        for group in together
        for suspect in group.shaken
        if suspect.tag in accused
    }


def cascades_doubts(found: Iterable[Cascade], said: Mapping[str, Said]) -> dict[str, Doubt]:
    """An outer loop is cleared only with the valve of each inner one, and never accused instead of it."""
    moved: dict[str, list[Cascade]] = {}
    for cascade in found:
        moved.setdefault(cascade.outer, []).append(cascade)
    return {
        outer: Doubt(MOVES_SET_POINT, cascade_text(inner, said))
        for outer, inner in moved.items()
        if outer in said and said[outer].stiction_probability is not None
        if not all(tag in said and said[tag].cleared for tag in (outer, *(one.inner for one in inner)))
    }


def reworded(doubt: Doubt, line: Mapping[str, Any]) -> dict[str, Any]:
    """What changes in an audit line. Verdict and probability stay: they are what the loop's own record says."""
    health, parts = line["health"], line["health_parts"]
    if _said(line).relied_on:
        doubted = doubted_health([HealthPart(**part) for part in parts], line["stiction_probability"])
        health, parts = doubted.value, [vars(part) for part in doubted.parts]
    return {
        "reliability": "not_reliable",
        "reasons": [{"code": doubt.code, "text": doubt.text}, *line["reasons"]],
        "health": health,
        "health_parts": parts,
    }


def heard_together(
    lines: Sequence[dict[str, Any]], candidates: Sequence[Candidate], excerpts: Mapping[str, Excerpts]
) -> list[dict[str, Any]]:
    """Audit lines of loops that were recorded on one clock, each heard beside the others. candidates: those of them
    that swing, excerpts: those of which OP or SP moves, both under their loop's name.
    """
    said = {line["loop"]: _said(line) for line in lines}
    found = all_doubts(said, candidates, excerpts)
    return [_heard(line, found.get(line["loop"])) for line in lines]


def _said(line: Mapping[str, Any]) -> Said:
    return Said(line["verdict"], line["reliability"], line["stiction_probability"])


def _heard(line: dict[str, Any], doubt: Doubt | None) -> dict[str, Any]:
    if doubt is None:
        return line
    return line | reworded(doubt, line)


def neighbour_text(shaken: Suspect, source: Suspect) -> str:
    """The probability of the source is less than that of the shaken loop only where its swing began sooner."""
    sticks, probability = source.stiction_probability or 0.0, shaken.stiction_probability or 0.0
    why = "is likelier to stick" if sticks >= probability else "is likely to stick too and whose swing began sooner"
    return (
        f"PV swings in step with {source.tag} (coherence {shaken.coherence:.2f}), whose valve {why} "
        f"({sticks:.2f} against {probability:.2f}) and may be what shakes this loop"
    )


def cascade_text(inner: Sequence[Cascade], said: Mapping[str, Said]) -> str:
    """inner: the cascades of one outer loop."""
    told = "; ".join(f"{one.inner}: {_in_words(said.get(one.inner))}" for one in inner)
    points = f"the set point{'s' if len(inner) > 1 else ''} of {' and '.join(one.inner for one in inner)}"
    return (
        f"OP is {points} (what is new in both is alike to {min(one.alike for one in inner):.2f}), so this loop moves "
        f"no valve by itself: the valve is judged there ({told})"
    )


def _in_words(said: Said | None) -> str:
    if said is None:
        return "not audited"
    words = VERDICT_WORDS[said.verdict]
    return words if said.stiction_probability is None else f"{words}, {RELIABILITY_BRIEF[said.reliability]}"
