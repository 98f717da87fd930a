"""Verdicts heard beside those of their neighbours: of loops that swing in step one shakes the others, and a valve that
is accused for its neighbour's sake is not relied on.
"""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.engine.health import HealthPart, doubted_health
from app.engine.plant_wide import Candidate, Group, Suspect, groups

SHAKEN_BY_NEIGHBOUR = "shaken_by_neighbour"


@dataclass(frozen=True)
class Doubt:
    """A loop whose verdict a neighbour's sticking valve explains as well."""

    shaken: Suspect
    source: Suspect


def doubts(together: Iterable[Group], relied_on: Container[str]) -> dict[str, Doubt]:
    """The doubts by tag. relied_on: tags of the loops whose valves are reliably said to stick."""
    return {
        suspect.tag: Doubt(suspect, group.suspects[0])
        for group in together
        for suspect in group.shaken
        if suspect.tag in relied_on
    }


def reworded(
    doubt: Doubt, probability: float, reasons: Iterable[Mapping[str, str]], health_parts: Iterable[Mapping[str, Any]]
) -> dict[str, Any]:
    """What changes in an audit line. Verdict and probability stay: they are what the loop's own record says."""
    text = neighbour_text(doubt.shaken, doubt.source, probability)
    health = doubted_health([HealthPart(**part) for part in health_parts], probability)
    return {
        "reliability": "not_reliable",
        "reasons": [{"code": SHAKEN_BY_NEIGHBOUR, "text": text}, *reasons],
        "health": health.value,
        "health_parts": [vars(part) for part in health.parts],
    }


def heard_together(lines: Sequence[dict[str, Any]], candidates: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Audit lines of loops that were recorded on one clock, each heard beside the others. candidates: those of them
    that swing, under their loop's name.
    """
    relied_on = {line["loop"] for line in lines if (line["verdict"], line["reliability"]) == ("stiction", "reliable")}
    found = doubts(groups(candidates), relied_on) if relied_on else {}
    return [_heard(line, found.get(line["loop"])) for line in lines]


def _heard(line: dict[str, Any], doubt: Doubt | None) -> dict[str, Any]:
    if doubt is None:
        return line
    return line | reworded(doubt, line["stiction_probability"], line["reasons"], line["health_parts"])


def neighbour_text(shaken: Suspect, source: Suspect, probability: float) -> str:
    """probability: that the valve of the shaken loop sticks; the source's is less only where its swing began sooner."""
    sticks = source.stiction_probability or 0.0
    why = "is likelier to stick" if sticks >= probability else "is likely to stick too and whose swing began sooner"
    return (
        f"PV swings in step with {source.tag} (coherence {shaken.coherence:.2f}), whose valve {why} "
        f"({sticks:.2f} against {probability:.2f}) and may be what shakes this loop"
    )
