"""What stored verdicts measured, as data; where an older release kept it in its sentences alone, read out of these.

Nobody else reads numbers out of sentences.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.engine.evidence import Measured
from app.engine.verdict.wording import figure, is_spoken, sentence
from app.services.moments import PlantClock
from app.services.telling.older_sentences import older_sentence
from app.services.telling.reasons import extra_in, reasons_of
from app.services.telling.wording import codes_in

SHAPE = "shape_"
MEASURED = "measured"
"""By code what the reasons of a verdict rest on: statistic, operator, threshold. Kept with the row, which outlives its
detail, so that two verdicts can be compared."""

_FIT = re.compile(r"a sticky valve explains (-?\d+) % of PV, a linear one (-?\d+) %")
_VOTE = re.compile(r"(\d+|none) says? (no stiction|stiction)")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?: %)?")
"""Of rows without `measured`."""

_BEGAN_AT = re.compile(r"has been sticking since ([^;]+);")
"""Of rows without the start of an episode."""

_BAND = re.compile(r"only after OP (?:had reversed by about|has gone some) (\d\S*) units")
"""Of rows without `hidden_band_op`; the second form is that of engines up to 0.1.18."""


@dataclass(frozen=True)
class Shape:
    """What a verdict says of one shape of PV and OP. figure: its value as its sentence tells it; value: the same as a
    number, shares as they are; both None where the sentence tells none. for_stiction: whether it speaks for a valve
    that sticks; None where that is not known."""

    text: str
    figure: str | None
    value: float | None
    for_stiction: bool | None = None


@dataclass(frozen=True)
class Explained:
    """Of PV in free run on cycles that no fit has seen, by a valve that sticks and by one that follows, in whole per
    cent."""

    sticky_pct: int
    linear_pct: int


@dataclass(frozen=True)
class Votes:
    """How many of the published methods that apply say each."""

    sticks: int
    free: int


def shapes(codes: str | None, text: str | None, extra_json: str | None) -> dict[str, Shape]:
    """By code, the loudest first. codes, text, extra_json: of a stored verdict."""
    measured = extra_in(extra_json).get(MEASURED)
    if measured is None:
        return _shapes_of_sentences(codes, text)
    named = [code for code in codes_in(codes) if code.startswith(SHAPE) and code in measured]
    told = {code: _shape(code.removeprefix(SHAPE), Measured(*measured[code])) for code in named}
    return {code: shape for code, shape in told.items() if shape is not None}


def explained(rival: Mapping[str, Any]) -> Explained | None:
    """rival: stiction among its rivals, as a verdict's detail has it; None where no valve could be fitted."""
    if "explained_without_stiction" not in rival:
        told = _FIT.search(rival["text"])
        return Explained(int(told[1]), int(told[2])) if told else None
    shares = rival["explained"], rival["explained_without_stiction"]
    return None if None in shares else Explained(*(round(100.0 * max(share, 0.0)) for share in shares))


def votes(detail: Mapping[str, Any]) -> Votes | None:
    """None where no published method applies."""
    if "methods" not in detail:
        return _votes_of_sentence(detail)
    said = [method["says"] for method in detail["methods"] if method["applies"]]
    return Votes(said.count("stiction"), said.count("no_stiction")) if said else None


def began_at(row: Mapping[str, Any], clock: PlantClock) -> str:
    """Since when the valve sticks, of a row whose reasons say that it began to; empty where it is not known."""
    if start := row.get("episode_start"):
        return clock.told(start)
    found = _BEGAN_AT.search(row.get("reasons_text") or "")
    return found[1] if found else ""


def band_of(row: Mapping[str, Any]) -> float | None:
    """The band that PV shows, unit of OP; None where it shows none."""
    if (size := row.get("hidden_band_op")) is not None:
        return float(size)
    found = _BAND.search(row.get("reasons_text") or "")
    return float(found[1]) if found else None


def _shape(name: str, found: Measured) -> Shape | None:
    """None of a shape that this release has no words for any more."""
    if not is_spoken(name, found.passed):
        return None
    told = figure(name, found.statistic)
    value = None if told is None else found.statistic
    return Shape(sentence(name, found.passed, found.statistic), told, value, found.passed)


def _shapes_of_sentences(codes: str | None, text: str | None) -> dict[str, Shape]:
    """Nothing where the sentences cannot be told apart."""
    named, told = codes_in(codes), reasons_of({"reasons": codes, "reasons_text": text})
    found = zip(named, told, strict=True) if len(named) == len(told) else ()
    return {code: _shape_of_sentence(code.removeprefix(SHAPE), told) for code, told in found if code.startswith(SHAPE)}


def _shape_of_sentence(name: str, text: str) -> Shape:
    found, side = _NUMBER.search(text), _side(name, text)
    if found is None:
        return Shape(text, None, None, side)
    share = found[0].endswith("%")
    return Shape(text, found[0], float(found[0].removesuffix(" %")) / (100.0 if share else 1.0), side)


def _side(name: str, text: str) -> bool | None:
    """Whether a shape's sentence is the one for stiction, the one against it, or none that is known."""
    said = _NUMBER.sub("", text)
    for side in (True, False):
        forms = (sentence(name, side, 0.5) if is_spoken(name, side) else None, older_sentence(name, side))
        if any(form is not None and _NUMBER.sub("", form) == said for form in forms):
            return side
    return None


def _votes_of_sentence(detail: Mapping[str, Any]) -> Votes | None:
    text = next((reason["text"] for reason in detail["reasons"] if reason["code"] == "published_methods"), "")
    counted = {side: 0 if count == "none" else int(count) for count, side in _VOTE.findall(text)}
    return Votes(counted.get("stiction", 0), counted.get("no stiction", 0)) if counted else None
