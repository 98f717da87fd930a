"""The points that a verdict rests on, and answers that disagree on one page."""

import pytest

from app.services.moments import UTC_CLOCK
from app.services.telling.reason_wording import _DOUBTS, REASON_WORDS
from app.services.telling.why_rely import (
    AGAINST,
    APART,
    DIVIDED,
    DOUBTED,
    OLDER,
    POOR,
    UNCLEAR,
    contradiction,
    derivative,
    names_otherwise,
    older_said,
    points,
)

FIT = "fitted on one half of each window a sticky valve explains 19 % of PV, a linear one 34 %: the shapes of PV and OP"
METHODS = (
    "of 9 published methods that apply, 3 say stiction (a, b, c), 6 say no stiction (d); they do not affect the verdict"
)


def told(verdict="stiction", reasons=(), **changes):
    row = {"verdict": verdict, "reliability": "reliable", "stiction_probability": 0.96, "likely_cause": verdict}
    row |= {"cycles": 12.0, "automatic_share": 1.0, "filled_share": 0.0, "table2_reading": "high_stiction"}
    given = {"published_methods": METHODS} | dict(reasons)
    detail = {"reasons": [{"code": code, "text": text} for code, text in given.items()]}
    detail["rivals"] = [{"code": "stiction", "text": FIT}, {"code": "disturbance", "text": "it drifts"}]
    return row | {"reasons": ";".join(given)} | changes, detail


def marks(row, detail):
    return {point.text.partition(":")[0]: point.mark for point in points(row, detail)}


def test_a_reliable_verdict_shows_what_agrees_and_what_does_not():
    found = points(*told())
    assert [point.mark for point in found] == ["✓"] * 6 + ["✗", "✗", "✓"]
    assert [point.text for point in found if not point.moves][:2] == [
        "fit: a sticky valve explains 19 % of PV, a linear one 34 %",
        "published methods: 3 say stiction, 6 say none",
    ]
    assert [point.mark for point in found if point.moves] == ["✓"] * 6


def test_the_same_figures_agree_with_a_valve_that_is_cleared():
    found = marks(*told("no_stiction", [("reference_disagrees", "it says stiction")], likely_cause=None))
    assert (found["fit"], found["published methods"], found["published rule"]) == ("✓", "✓", "✗")
    assert found["other explanations"] == "·"


@pytest.mark.parametrize(("verdict", "mark"), [("stiction", "✗"), ("no_stiction", "✓"), ("inconclusive", None)])
def test_a_loop_that_another_may_shake_is_not_said_to_be_moved_by_none(verdict, mark):
    found = [point for point in points(*told(verdict), shaken_by="P1") if point.text.startswith("other loops")]
    assert [point.mark for point in found] == ([mark] if mark else [])
    assert all("in step with P1" in point.text for point in found)


@pytest.mark.parametrize(
    ("code", "point"),
    [("few_cycles", "length"), ("uncoupled", "PV and OP"), ("evidence_not_clear", "shapes"),
     ("linear_look_alikes", "shapes"), ("outside_corners", "PV and OP"), ("filled_share", "record"),
     ("shaken_by_neighbour", "other loops"), ("before_repair", "time"), ("disturbance", "other explanations")],
)  # fmt: skip
def test_what_takes_the_reliability_is_crossed(code, point):
    assert marks(*told(reasons=[(code, "told")]))[point] == "✗"


def test_a_cross_beside_a_reliable_verdict_was_only_heard():
    quantised = [("pv_quantised", "PV moves in steps")]
    (crossed,) = (point for point in points(*told(reasons=quantised)) if point.text.startswith("record"))
    assert (crossed.text, crossed.moves) == ("record: PV moves in steps", False)
    unsure = told(reasons=quantised, reliability="not_reliable")
    (crossed,) = (point for point in points(*unsure) if point.text.startswith("record"))
    assert (crossed.text, crossed.moves) == ("record: PV moves in steps", True)


def test_a_check_that_did_not_pass_and_does_not_count_stands_beside_what_counts():
    row, detail = told(reasons=[("pv_quantised", "PV moves in steps")])
    assert not any(point.text.startswith("checks") for point in points(row, detail))
    detail["reasons"].append({"code": "irregular_sampling", "text": "interpolated to even steps"})
    outcomes = {"op_interpolated": "fail", "pv_quantised": "fail", "gaps": "pass", "irregular_sampling": "fail"}
    detail["findings"] = [{"code": code, "outcome": outcome} for code, outcome in outcomes.items()]
    (silent,) = (point for point in points(row, detail) if point.text.startswith("checks"))
    assert (silent.mark, silent.moves) == ("·", True)
    assert "op interpolated (an integrating controller" in silent.text
    assert silent.text.endswith("; irregular sampling")
    assert "quantised" not in silent.text


@pytest.mark.parametrize(
    ("verdict", "laws", "said"),
    [
        ("no_stiction", {"controller": {"kc": -2.0, "kd": -8.0}}, True),
        ("no_stiction", {"controller": {"kc": 2.0, "kd": 0.1}, "given_controller": None}, False),
        ("no_stiction", {"controller": {"kc": 2.0, "kd": 0.0}, "given_controller": {"kc": 1.0, "kd": 3.0}}, True),
        ("no_stiction", {"controller": {"kc": 0.0, "kd": 0.0}}, False),
        ("stiction", {"controller": {"kc": 2.0, "kd": 8.0}}, False),
    ],
)
def test_derivative_action_is_told_where_it_is_known_and_no_valve_is_accused(verdict, laws, said):
    assert bool(derivative(told(verdict)[0], {"closed_loop": laws})) is said


def test_without_a_known_law_nothing_is_said_of_it():
    row = told("no_stiction")[0]
    assert [derivative(row, found) for found in (None, {}, {"closed_loop": None})] == [None] * 3


def test_every_code_that_is_looked_for_is_one():
    assert {*UNCLEAR, *APART, *DIVIDED, *POOR, *DOUBTED, *OLDER} <= set(REASON_WORDS)


def test_every_doubt_of_a_valve_that_was_judged_is_crossed():
    of_no_verdict, not_against = {"no_variation", "pv_does_not_answer", "prior_only"}, {"set_point_rests"}
    assert set(_DOUBTS) - of_no_verdict - not_against <= AGAINST


def test_what_was_not_judged_has_no_points():
    assert points(*told("inconclusive")) == []


def test_an_explanation_that_names_stiction_contradicts_a_cleared_valve():
    row, _ = told("no_stiction")
    found = {"state": "done", "effects": [{"effect": "valve.stiction", "probability": 0.7}]}
    assert "by the explanation below it does (probability 0.70)" in contradiction(row, found)
    assert contradiction(told()[0], found) is None
    assert contradiction(row, None) is None
    assert contradiction(row, {"state": "open", "effects": []}) is None
    assert contradiction(row, {"state": "done", "effects": []}) is None
    older = {**found, "window_start": "2026-03-01T00:00:00Z", "window_end": "2026-03-01T01:00:00Z"}
    assert contradiction(row, older, "2026-03-01T02:00:00Z") is None
    assert contradiction(row, older, "2026-03-01T00:30:00Z") == contradiction(row, older) == contradiction(row, found)
    other = {"effect": "process.resonance", "probability": 0.9}
    assert contradiction(row, {"state": "done", "effects": [*found["effects"], other]}) is None


@pytest.mark.parametrize(("likely", "why"), [(0.28, "can hardly tell"), (0.8, "may also be true")])
def test_where_an_explanation_names_no_valve_it_is_said_which_to_follow(likely, why):
    effects = [{"effect": "process.outflow_law", "alternatives": [], "probability": likely}]
    found = {"state": "done", "effects": effects}
    said = names_otherwise(told()[0], found)
    assert f"(probability {likely:.2f}). Follow the verdict" in said
    assert why in said
    assert names_otherwise(told(reliability="not_reliable")[0], found) is None
    assert names_otherwise(told("no_stiction")[0], found) is None
    older = {**found, "window_start": "2026-03-01T00:00:00Z", "window_end": "2026-03-01T01:00:00Z"}
    assert names_otherwise(told()[0], older, "2026-03-01T02:00:00Z") is None
    later = told()[0] | {"window_start": "2026-06-01T00:00:00Z", "window_end": "2026-06-02T00:00:00Z"}
    assert names_otherwise(later, older, None, 100.0) == said
    assert names_otherwise(later, older, None, 35.0) is None
    assert older_said(later, older, None, 100.0, UTC_CLOCK) is None
    assert older_said(later, older, "2026-03-01T02:00:00Z", 35.0, UTC_CLOCK) is None, "of before the repair"
    words = older_said(later, older, None, 35.0, UTC_CLOCK)
    assert words.startswith(f"An older explanation named something other than the valve (probability {likely:.2f})")
    assert "up to 2026-03-01" in words
    assert older_said(later, None, None, 35.0, UTC_CLOCK) is None
    effects[0]["alternatives"] = ["valve.deadband"]
    assert names_otherwise(told()[0], found) is None
