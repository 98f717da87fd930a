"""What templates call: numbers, times and words for people."""

import pytest

from app.cli.tables import verdict_cells
from app.services.audit_json.models import ReliabilityRow
from app.services.rendering import figure
from app.services.telling.reasons import first_reasons, reasons_of
from app.services.telling.wording import cause_words, measured_probability, probability, weakly, worst_first
from app.web.columns import query_without
from app.web.rendering import TEMPLATES, as_tags, other_way


def row(**changes) -> dict:
    values = dict.fromkeys(name for name, field in ReliabilityRow.model_fields.items() if field.is_required())
    values |= {"recording": "FIC1", "loop": "FIC1", "samples": 10, "verdict": "stiction", "reliability": "reliable"}
    values |= {
        "stiction_probability": 0.9,
        "engine_version": "1",
        "elapsed_s": 0.1,
        "reasons": "a",
        "reasons_text": "A",
    }
    values |= {"input_fingerprint": "f", "config_fingerprint": "f"}
    return ReliabilityRow(**(values | changes)).model_dump(mode="json")


@pytest.mark.parametrize(("value", "digits", "text"), [(None, 2, "–"), (0.126, 2, "0.13"), (3.0, 0, "3")])
def test_figures(value, digits, text):
    assert figure(value, digits) == text


def test_the_surest_sticky_valve_comes_first_and_what_is_fine_last():
    rows = [
        row(recording="fine", verdict="no_stiction", stiction_probability=0.1),
        row(recording="dead", verdict="not_auditable", stiction_probability=None),
        row(recording="doubtful", verdict="inconclusive", stiction_probability=0.5),
        row(recording="weak", reliability="not_reliable", stiction_probability=0.99),
        row(recording="b", stiction_probability=0.8),
        row(recording="a", stiction_probability=0.8),
        row(recording="c", stiction_probability=0.95),
    ]
    assert [line["recording"] for line in worst_first(rows)] == ["c", "a", "b", "weak", "doubtful", "dead", "fine"]


def test_a_pv_that_never_answers_comes_among_what_wants_a_look():
    rows = [
        row(recording="doubtful", verdict="inconclusive", stiction_probability=0.7),
        row(recording="weak", reliability="not_reliable", stiction_probability=0.55),
        row(
            recording="stuck",
            verdict="inconclusive",
            reliability="not_reliable",
            stiction_probability=0.6,
            likely_cause="stuck_valve_or_dead_transmitter",
        ),
        row(recording="sure", stiction_probability=0.8),
    ]
    assert [line["recording"] for line in worst_first(rows)] == ["sure", "stuck", "weak", "doubtful"]
    rows[2] |= {"verdict": "not_auditable", "stiction_probability": None}
    assert [line["recording"] for line in worst_first(rows)] == ["sure", "stuck", "weak", "doubtful"]


def test_the_table_shows_the_weightiest_reasons_only():
    assert first_reasons(told("a;b;c", "A (0.72). B. C")) == "A (0.72). B ..."
    assert first_reasons(told("a;b", "A. B")) == "A. B"


def test_reasons_that_stand_one_after_the_other_begin_as_sentences_do():
    assert first_reasons(told("a;b;c", "few cycles. the valve is slow. c")) == "Few cycles. The valve is slow ..."
    assert first_reasons(told("a", "")) == ""


def test_a_tag_with_a_full_stop_in_it_ends_no_reason():
    shaken = "PV swings in step with T. 101 (coherence 0.90)"
    row = told("shaken_by_neighbour;few_cycles", f"{shaken}. few cycles")
    assert reasons_of(row) == [shaken, "few cycles"]
    assert first_reasons(row, 1) == f"{shaken} ..."
    outer = "OP is the set point of FIC. 1 and the set point of FIC. 2"
    assert reasons_of(told("before_repair;moves_set_point;b", f"A. {outer}. B")) == ["A", outer, "B"]


def test_reasons_that_an_older_release_worded_are_told_as_they_stand():
    assert reasons_of(told("a", "A. and more")) == ["A", "and more"]
    assert reasons_of(told("shaken_by_neighbour;b", "A")) == ["A"]
    assert reasons_of({"reasons": None, "reasons_text": None}) == [""]


def test_a_tag_that_is_read_from_the_right_keeps_its_place_in_a_reason():
    row = told("shaken_by_neighbour", "in step with \u05d7\u05dd-7 (0.9)")
    assert first_reasons(row) == "In step with \u2068\u05d7\u05dd-7\u2069 (0.9)"
    assert reasons_of(row) == [row["reasons_text"]]  # as clients get it


def told(codes: str, text: str) -> dict[str, str]:
    return {"reasons": codes, "reasons_text": text}


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "–"), (0.9956, "over 0.99"), (0.9949, "0.99"), (0.7, "0.70"), (0.0049, "under 0.01"), (0.0, "under 0.01")],
)
def test_no_probability_is_told_as_certain(value, text):
    assert probability(value) == text


def test_a_second_click_turns_the_order_round():
    assert other_way("health") == "-health"
    assert other_way("-health") == "health"


def test_addresses_keep_what_was_chosen_and_leave_out_what_is_empty():
    told = {"search": "a&b", "unit": "", "column": ["unit", "health"], "sort": "loop"}
    assert query_without(told) == "search=a%26b&column=unit&column=health&sort=loop"
    assert query_without(told, "column", sort="-health") == "search=a%26b&sort=-health"


def test_tags_of_an_upload_are_listed_with_their_loop_and_signal():
    loop = {"loop": "FIC1", "pv": "FIC1.PV", "op": None, "sp": "S", "mode": None, "others": ["FIC1.X"]}
    assert as_tags([loop]) == [("FIC1.PV", "FIC1", "PV"), ("S", "FIC1", "SP"), ("FIC1.X", "FIC1", "OTHER")]


def test_causes_without_words_are_still_readable():
    assert cause_words("a_new_cause") == "a new cause"
    assert cause_words(None) == "not known"


def test_a_prior_is_no_measurement_in_rows_and_in_lines():
    assert measured_probability({"reasons": "a;prior_only", "stiction_probability": 0.6}) is None
    assert measured_probability({"reasons": [{"code": "prior_only", "text": ""}], "stiction_probability": 0.6}) is None
    assert measured_probability({"reasons": [{"code": "a", "text": ""}], "stiction_probability": 0.6}) == 0.6
    assert measured_probability({"reasons": None, "stiction_probability": 0.6}) == 0.6
    assert verdict_cells(line(reasons=[{"code": "prior_only", "text": "a prior"}]))[2].plain == "-"


def line(**changes) -> dict:
    told = {
        "recording": "A",
        "loop": "A",
        "verdict": "inconclusive",
        "stiction_probability": 0.6,
        "reliability": "not_reliable",
    }
    return {**told, "stiction_size": {"S": None}, "yper_pct": None, **changes}


@pytest.mark.parametrize(
    ("changes", "weak"),
    [
        ({"stiction_probability": 0.52}, True),
        ({"stiction_probability": 0.44, "verdict": "no_stiction"}, True),
        ({"stiction_probability": 0.52, "reliability": "reliable"}, False),
        ({"stiction_probability": 0.9}, False),
        ({"stiction_probability": 0.5, "verdict": "inconclusive"}, False),
        ({"stiction_probability": 0.52, "reasons": "prior_only"}, False),
    ],
)
def test_a_verdict_near_one_half_is_shown_as_a_weak_one(changes, weak):
    said = row(**{"reliability": "not_reliable", **changes})
    assert weakly(said) is weak
    shown = str(TEMPLATES.get_template("_macros.html").module.verdict(said))
    assert ("possibly" in shown, "weakly" in shown) == (weak, weak)
