"""Codes in plain words, and which loop comes first: the same on the command line, on the pages and in reports."""

from collections.abc import Iterable, Mapping
from typing import Any

VERDICT_WORDS = {
    "stiction": "valve sticks",
    "inconclusive": "cannot tell",
    "not_auditable": "not auditable",
    "no_stiction": "no stiction",
}
VERDICT_RANK = ("stiction", "inconclusive", "not_auditable", "no_stiction")

RELIABILITY_WORDS = {
    "reliable": "the evidence agrees; rely on it",
    "not_reliable": "the evidence disagrees; look before you act",
}


def worst_first(lines: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Sticky valves first, the surest of them at the top; loops without a complaint last; ties by name."""
    return sorted(lines, key=_badness)


def _badness(line: Mapping[str, Any]) -> tuple[int, bool, float, str]:
    probability = line.get("stiction_probability")
    return (
        VERDICT_RANK.index(line["verdict"]),
        line["reliability"] != "reliable",
        -(probability if probability is not None else 0.0),
        str(line["recording"]),
    )
