"""Which verdicts a neighbour's valve puts in doubt, and what is then said."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.engine.audit import audit
from app.engine.plant_wide.excerpts import Excerpts
from app.engine.plant_wide.groups import Candidate, Suspect, groups
from app.lab.testbench import neighbours
from app.lab.testbench.neighbours import SOURCE
from app.services.audit_json import swings
from app.services.audit_json.excerpts import as_json, by_tag
from app.services.audit_json.line import audit_line
from app.services.auditing import hearing
from app.services.auditing.hearing import SHAKEN_BY_NEIGHBOUR, Said, hear, heard_together, neighbour_text

SHAKEN = ("shaken 0", "shaken 1", "shaken 2")


@cache
def audited() -> tuple[Sequence[dict[str, Any]], Sequence[Candidate]]:
    """A valve that sticks and three healthy loops that it shakes, each called sticky reliably by its own record."""
    found = {
        tag: audit(loop.recording(tag)) for tag, loop in neighbours.plant(1010).items() if tag in (SOURCE, *SHAKEN)
    }
    swinging = [
        swings.candidate(tag, one.swing, one.judgement.stiction_probability, 0.0)
        for tag, one in found.items()
        if one.swing is not None
    ]
    return [audit_line(one, 0.1) for one in found.values()], swinging


def said(tag: str, **of_its_own: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """The line of a loop whose own record said so, before and after it was heard with the others."""
    lines, swinging = audited()
    before = [line | of_its_own if line["loop"] == tag else line for line in lines]
    after = heard_together(before, swinging, {})
    assert [line["loop"] for line in after] == [SOURCE, *SHAKEN]
    at = [line["loop"] for line in before].index(tag)
    return before[at], after[at]


def test_reliability_reasons_and_health_change_and_nothing_else() -> None:
    before, after = said(SHAKEN[0])
    assert (before["verdict"], before["reliability"]) == ("stiction", "reliable")
    changed = {name for name in before if before[name] != after[name]}
    assert changed == {"reliability", "reasons", "health", "health_parts"}
    assert after["reliability"] == "not_reliable"
    assert after["reasons"][0]["code"] == SHAKEN_BY_NEIGHBOUR
    assert after["reasons"][1:] == before["reasons"]


@pytest.mark.parametrize(
    ("tag", "of_its_own"),
    [
        (SOURCE, {}),
        (SHAKEN[1], {"verdict": "no_stiction"}),
        (SHAKEN[1], {"verdict": "inconclusive", "reliability": "not_reliable"}),
        (SHAKEN[1], {"verdict": "not_auditable", "reliability": "not_reliable", "stiction_probability": None}),
    ],
)
def test_a_verdict_that_is_not_against_the_valve_stays(tag: str, of_its_own: dict[str, Any]) -> None:
    before, after = said(tag, **of_its_own)
    assert after is before


def test_who_looks_at_a_loop_that_may_stick_is_told_where_to_look_first() -> None:
    before, after = said(SHAKEN[1], reliability="not_reliable")
    assert after["reasons"][0]["code"] == SHAKEN_BY_NEIGHBOUR
    assert after["reasons"][1:] == before["reasons"]
    assert {name for name in before if before[name] != after[name]} == {"reasons"}


def test_a_loop_that_does_not_swing_is_heard_with_nobody() -> None:
    lines, swinging = audited()
    kept = [candidate for candidate in swinging if candidate.tag != SHAKEN[2]]
    assert heard_together(lines, kept, {})[-1] is lines[-1]
    assert heard_together(lines, [], {}) == list(lines)


@cache
def told_of() -> dict[str, Said]:
    """What the records of the loops say, of which one is cleared."""
    lines, _ = audited()
    told = {line["loop"]: Said(line["verdict"], line["reliability"], line["stiction_probability"]) for line in lines}
    return told | {SHAKEN[2]: Said("no_stiction", "reliable", 0.1)}


@pytest.mark.parametrize("tag", [SOURCE, *SHAKEN])
def test_of_a_loop_that_is_asked_for_alone_the_same_is_told(tag: str) -> None:
    _, swinging = audited()
    of_all = hear(told_of(), swinging, [])
    assert set(of_all) == set(SHAKEN[:2])
    assert hear(told_of(), swinging, [], asked={tag}).get(tag) == of_all.get(tag)


@pytest.mark.parametrize(("tag", "looked_for"), [(SHAKEN[0], 1), (SHAKEN[2], 0)])
def test_who_swings_together_is_found_only_for_loops_that_it_could_say_something_of(
    monkeypatch: pytest.MonkeyPatch, tag: str, looked_for: int
) -> None:
    """It takes seconds in a plant, and ends the audit of one loop."""
    calls: list[Sequence[Candidate]] = []
    monkeypatch.setattr(hearing, "groups", lambda all_of_them: calls.append(all_of_them) or groups(all_of_them))
    hear(told_of(), audited()[1], [], asked={tag})
    assert len(calls) == looked_for


def test_a_source_that_swung_sooner_is_not_called_likelier() -> None:
    shaken = Suspect("TIC201", 0.95, 1.4, 9000.0, 0.91, -3.0)
    source = Suspect("FIC101", 0.85, 1.7, None, 1.0, 0.0)
    assert "is more likely to stick (0.98 against 0.95)" in neighbour_text(
        shaken, replace(source, stiction_probability=0.98)
    )
    assert "whose oscillation began sooner (0.85 against 0.95)" in neighbour_text(shaken, source)


@pytest.mark.parametrize(
    ("source", "shaken", "told"),
    [
        (0.9931, 0.9912, "valve is as likely to stick (0.99) and may be"),
        (0.9912, 0.9931, "valve is as likely to stick and whose oscillation began sooner (0.99) and may be"),
        (0.9912, 0.9912, "valve is as likely to stick (0.99) and may be"),
    ],
)
def test_a_source_whose_probability_is_told_alike_is_not_called_likelier(
    source: float, shaken: float, told: str
) -> None:
    both = (Suspect(tag, p, 1.0, None, 1.0, 0.0) for tag, p in (("TIC201", shaken), ("FIC101", source)))
    assert told in neighbour_text(*both)


@pytest.mark.parametrize(("start_s", "together"), [(0.0, False), (1_750_000_000.0, True)])
def test_records_without_a_date_are_in_step_with_nobody(start_s: float, together: bool) -> None:
    """Files that begin at second 0 all get 1970-01-01, whatever plant they are of."""
    rows = [
        SimpleNamespace(tag=one.tag, unit=None, stiction_probability=0.9, swing_json=swings.as_json(one.swing, start_s))
        for one in audited()[1]
    ]
    assert bool(groups(swings.candidates(rows))) == together


@pytest.mark.parametrize(("number", "kept"), [(0, []), (3_000_000, ["FIC1"])])
def test_no_set_point_is_looked_for_in_records_without_a_date(number: int, kept: list[str]) -> None:
    told = Excerpts(10.0, np.array([number]), np.arange(64.0)[None, :], None)
    assert list(by_tag([SimpleNamespace(tag="FIC1", excerpts_json=as_json(told))])) == kept
