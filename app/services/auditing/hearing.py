"""Verdicts heard beside those of other loops: of loops that swing in step one shakes the others, and a valve that is
accused for its neighbour's sake is not relied on; where its OP is the set point of another loop, the valve is there.
"""

from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from app.engine.codes import ReasonCode
from app.engine.evidence import told_probability
from app.engine.health import HealthPart, doubted_health
from app.engine.plant_wide.cascades import Cascade, cascades
from app.engine.plant_wide.excerpts import Excerpts
from app.engine.plant_wide.groups import Candidate, Group, Suspect, groups
from app.engine.plant_wide.stood_together import CHANCE
from app.services.audit_json.models import ReasonLine
from app.services.auditing.unanswered import Standing, of_lines
from app.services.telling.wording import (
    MOVES_NO_VALVE,
    MOVES_SET_POINT,
    RELIABILITY_BRIEF,
    SHAKEN_BY_NEIGHBOUR,
    STOOD_TOGETHER,
    VERDICT_WORDS,
)


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
    """What other loops tell of a verdict: the reason, as it stands first, for which nobody should rely on it.
    chance_probability: that it is chance, where that is what tells."""

    code: ReasonCode
    text: str
    chance_probability: float | None = None

    @property
    def line(self) -> ReasonLine:
        if self.chance_probability is None:
            return ReasonLine(code=self.code, text=self.text)
        measured = {"statistic": self.chance_probability, "threshold": CHANCE}
        return ReasonLine(code=self.code, text=self.text, operator="<", passed=True, **measured)


@dataclass(frozen=True)
class Heard:
    """What other loops tell of one. doubt: None where its verdict stays as it is. moves: whose set points its OP is.
    moved_by: whose OP its set point is, one loop but where two have the same OP. fields: of its row, what else they
    tell.
    """

    doubt: Doubt | None = None
    moves: tuple[str, ...] = ()
    moved_by: tuple[str, ...] = ()
    fields: Mapping[str, Any] = field(default_factory=dict)


def hear(
    said: Mapping[str, Said],
    candidates: Sequence[Candidate],
    shown: Sequence[Cascade],
    asked: Collection[str] | None = None,
    moves_valve: Mapping[str, bool] | None = None,
    standing: Mapping[str, Standing] | None = None,
) -> dict[str, Heard]:
    """The loops of which others tell something, by tag. candidates: those that swing. shown: the cascades that a loop
    asked about is a part of. asked: the loops of which alone is asked; None: of all. moves_valve: of loops of which
    somebody states it, whether OP moves a valve and not the set point of another loop: whatever was found. standing:
    the loops in which PV does not answer OP; with which others it came to stand goes before what else others tell.
    """
    stated = moves_valve or {}
    found = [cascade for cascade in shown if not stated.get(cascade.outer)]
    without_valve = {tag for tag, has in stated.items() if not has}
    called = {tag for tag, one in said.items() if one.verdict == "stiction"}
    if asked is not None:
        concerned = {*asked, *(tag for cascade in found for tag in (cascade.outer, cascade.inner))}
        called &= concerned & {candidate.tag for candidate in candidates}
    # Who swings together is found among all or not at all, which takes seconds of a plant.
    shaken = neighbours_doubts(groups(candidates), called, found) if called else {}
    doubted = {tag: replace(said[tag], reliability="not_reliable") for tag in shaken}
    doubts = shaken | cascades_doubts(found, {**said, **doubted}, without_valve)
    stand = standing or {}
    doubts |= {
        tag: Doubt(STOOD_TOGETHER, one.text, one.chance_probability)
        for tag, one in stand.items()
        if one.text is not None
    }
    moves, moved_by = _by(found, lambda cascade: cascade.outer), _by(found, lambda cascade: cascade.inner)
    return {
        tag: Heard(
            doubts.get(tag),
            moves=tuple(cascade.inner for cascade in moves.get(tag, ())),
            moved_by=tuple(cascade.outer for cascade in moved_by.get(tag, ())),
            fields=stand[tag].fields if tag in stand else {},
        )
        for tag in sorted({*doubts, *moves, *moved_by, *stand} & said.keys())
    }


def _by(found: Iterable[Cascade], loop: Callable[[Cascade], str]) -> dict[str, list[Cascade]]:
    together: dict[str, list[Cascade]] = {}
    for cascade in found:
        together.setdefault(loop(cascade), []).append(cascade)
    return together


def neighbours_doubts(
    together: Iterable[Group], called: Container[str], found: Iterable[Cascade] = ()
) -> dict[str, Doubt]:
    """called: tags of the loops whose valves are said to stick, reliably or not: those are told which valve to look at
    first. An outer loop takes nothing from the verdict of its inner one, for whose valve both swing.
    """
    one_valve = {(cascade.outer, cascade.inner) for cascade in found}
    return {
        suspect.tag: Doubt(SHAKEN_BY_NEIGHBOUR, neighbour_text(suspect, group.suspects[0]))
        for group in together
        for suspect in group.shaken
        if suspect.tag in called and (group.suspects[0].tag, suspect.tag) not in one_valve
    }


def cascades_doubts(
    found: Iterable[Cascade], said: Mapping[str, Said], without_valve: Collection[str] = ()
) -> dict[str, Doubt]:
    """Where an inner loop is not cleared, nobody should rely on what is said of the outer one, from the innermost loop
    outwards. One that is accused while all its inner loops are cleared may have a valve of its own, unless it is among
    those without_valve, as is stated of them: one of these is cleared with inner loops that are found, or not at all.
    """
    moves, now = _by(found, lambda cascade: cascade.outer), dict(said)
    moves |= {tag: [] for tag in without_valve if tag not in moves}
    judged = [tag for tag in moves if tag in said and said[tag].stiction_probability is not None]

    def spoken_for(tag: str) -> bool:
        by_itself = tag not in without_valve or (moves[tag] and not said[tag].accused)
        return bool(by_itself) and all(_cleared(now.get(one.inner)) for one in moves[tag])

    doubted: set[str] = set()
    # Once for each loop of the longest chain: whose inner loop is doubted is doubted the next time.
    while further := {tag for tag in judged if tag not in doubted and not spoken_for(tag)}:
        doubted |= further
        now |= {tag: replace(said[tag], reliability="not_reliable") for tag in further}
    stated = doubted & set(without_valve)
    doubts = {tag: Doubt(MOVES_NO_VALVE, without_valve_text(moves[tag], now)) for tag in stated}
    return doubts | {tag: Doubt(MOVES_SET_POINT, cascade_text(moves[tag], now)) for tag in doubted - stated}


def _cleared(said: Said | None) -> bool:
    return said is not None and said.cleared


def reworded(heard: Heard, line: Mapping[str, Any]) -> dict[str, Any]:
    """What changes in an audit line. Verdict and probability stay: they are what the loop's own record says."""
    reliability, reasons, health, parts = (line[name] for name in ("reliability", "reasons", "health", "health_parts"))
    if heard.doubt is not None:
        if reliability == "reliable":
            doubted = doubted_health([HealthPart(**part) for part in parts], line["stiction_probability"])
            health, parts = doubted.value, [vars(part) for part in doubted.parts]
        reliability, reasons = "not_reliable", [heard.doubt.line.model_dump(), *reasons]
    return {
        "reliability": reliability,
        "reasons": reasons,
        "health": health,
        "health_parts": parts,
        "moves_set_point_of": ";".join(heard.moves) or None,
        "set_point_moved_by": ";".join(heard.moved_by) or None,
        **heard.fields,
    }


def heard_together(
    lines: Sequence[dict[str, Any]], candidates: Sequence[Candidate], excerpts: Mapping[str, Excerpts]
) -> list[dict[str, Any]]:
    """Audit lines of loops that were recorded on one clock, each heard beside the others. candidates: those of them
    that swing, excerpts: those of which OP or SP moves, both under their loop's name.
    """
    said = {line["loop"]: Said(line["verdict"], line["reliability"], line["stiction_probability"]) for line in lines}
    heard = hear(said, candidates, cascades(excerpts), standing=of_lines(lines))
    return [line | reworded(heard[line["loop"]], line) if line["loop"] in heard else line for line in lines]


def neighbour_text(shaken: Suspect, source: Suspect) -> str:
    """The probability of the source is less than that of the shaken loop only where its swing began sooner."""
    sticks, probability = source.stiction_probability or 0.0, shaken.stiction_probability or 0.0
    told, beside = told_probability(sticks), told_probability(probability)
    alike, sooner = told == beside, " and whose oscillation began sooner" if sticks < probability else ""
    likely = "as likely to stick" if alike else "likely to stick too" if sooner else "more likely to stick"
    return (
        f"PV oscillates in step with {source.tag} (coherence {shaken.coherence:.2f}), whose valve is {likely}{sooner} "
        f"({told if alike else f'{told} against {beside}'}) and may be disturbing this loop"
    )


def cascade_text(inner: Sequence[Cascade], said: Mapping[str, Said]) -> str:
    """inner: the cascades of one outer loop."""
    alike = min(one.alike for one in inner)
    return (
        f"OP is {_set_points(inner)} (from sample to sample they move alike, {alike:.2f} of 1): unless OP also "
        f"moves a valve of its own, the valve is judged there ({_told_there(inner, said)})"
    )


def without_valve_text(inner: Sequence[Cascade], said: Mapping[str, Said]) -> str:
    """inner: the cascades of one outer loop that is stated to move no valve; none where they are not found."""
    stated = "OP moves no valve of its own, according to the loop's settings"
    if not inner:
        return f"{stated}: the valve is judged at the loop whose set point OP is, which the records do not show"
    return f"{stated}, but {_set_points(inner)}: the valve is judged there ({_told_there(inner, said)})"


def _set_points(inner: Sequence[Cascade]) -> str:
    return " and ".join(f"the set point of {one.inner}" for one in inner)


def _told_there(inner: Sequence[Cascade], said: Mapping[str, Said]) -> str:
    return "; ".join(f"{one.inner}: {_in_words(said.get(one.inner))}" for one in inner)


def _in_words(said: Said | None) -> str:
    if said is None:
        return "not audited"
    words = VERDICT_WORDS[said.verdict]
    return words if said.stiction_probability is None else f"{words}, {RELIABILITY_BRIEF[said.reliability]}"
