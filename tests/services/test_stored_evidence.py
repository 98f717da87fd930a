"""What verdicts measured is read as data, and out of the sentences of releases that stored nothing else."""

from types import SimpleNamespace

import pytest

from app.services.plant.evidence_moved import moved
from app.services.telling.stored_evidence import Explained, Shape, Votes, explained, shapes, votes

STANDS = '{"measured":{"shape_sticking":[0.6,">",0.2],"shape_op_kurtosis":[-1.2,"<",0.1],"few_cycles":[3.0,">=",5.0]}}'
CLEARED = '{"measured":{"shape_sticking":[0.08,">",0.2],"shape_op_kurtosis":[2.4,"<",0.1]}}'
CODES = "shape_sticking;shape_op_kurtosis;few_cycles"


def test_shapes_are_told_from_what_is_stored_whatever_the_sentences_say():
    found = shapes(CODES, "one. two. three", STANDS)
    assert found == {
        "shape_sticking": Shape(
            "PV stands while OP moves, and then follows it, for 60 % of the time", "60 %", 0.6, True
        ),
        "shape_op_kurtosis": Shape("OP has the spread of a triangle or sine, not of noise", None, None, True),
    }
    assert shapes(CODES, "", CLEARED)["shape_sticking"] == Shape(
        "PV hardly ever stands while OP moves and then follows it (8 % of the time)", "8 %", 0.08, False
    )


def test_a_shape_that_has_no_words_any_more_is_left_out():
    assert shapes("shape_gone", "it is gone", '{"measured":{"shape_gone":[1.0,">",0.0]}}') == {}


@pytest.mark.parametrize("extra_json", [None, "{}", '{"cycles":12.0}'])
def test_of_an_older_release_the_sentences_are_read(extra_json):
    told = "PV stands for 60 % of the time. OP runs in triangles. -0.42 of it. few"
    codes = "shape_sticking;shape_op_triangle;shape_gain;few_cycles"
    assert shapes(codes, told, extra_json) == {
        "shape_sticking": Shape("PV stands for 60 % of the time", "60 %", 0.6),
        "shape_op_triangle": Shape("OP runs in triangles", None, None, True),
        "shape_gain": Shape("-0.42 of it", "-0.42", -0.42),
    }
    assert shapes("shape_gain", "two. sentences", extra_json) == {}


def changed(now, before):
    told = {"reasons": CODES, "reasons_text": "PV stands 60 %. OP is smooth. few", "extra_json": now}
    told |= {f"{name}_before": value for name, value in told.items()} | {"extra_json_before": before}
    return SimpleNamespace(verdict="stiction", probability=0.99, probability_before=0.1, **told)


def test_what_moved_is_told_in_the_figures_that_are_stored():
    assert moved(changed(STANDS, CLEARED)) == (
        "PV stands while OP moves, and then follows it, for 60 % of the time (8 % before), probability 0.10 -> 0.99"
    )
    assert moved(changed(STANDS, STANDS)).startswith("PV stands while OP moves, and then follows it, for 60 % of the")


def test_what_speaks_against_a_verdict_is_no_news_of_it():
    assert moved(changed(CLEARED, STANDS)) == "probability 0.10 -> 0.99"


def test_a_verdict_of_now_is_compared_with_one_of_an_older_release():
    row = changed(STANDS, "{}")
    row.reasons_text_before = "PV stood for 8 % of the time. OP is smooth. few"
    assert "for 60 % of the time (8 % before), " in moved(row)


def test_how_much_a_valve_explains_is_what_is_stored_whatever_the_sentence_says():
    told = {"text": "a sticky valve explains 1 % of PV, a linear one 2 %"}
    assert explained(told | {"explained": 0.194, "explained_without_stiction": -0.3}) == Explained(19, 0)
    assert explained(told | {"explained": 0.194, "explained_without_stiction": None}) is None
    assert explained(told | {"explained": 0.194}) == Explained(1, 2)
    assert explained({"text": "worded otherwise"}) is None


def test_votes_are_counted_from_what_each_method_says():
    said = [("stiction", True), ("stiction", True), ("no_stiction", True), (None, True), ("stiction", False)]
    methods = [{"says": says, "applies": applies} for says, applies in said]
    assert votes({"methods": methods, "reasons": []}) == Votes(2, 1)
    assert votes({"methods": methods[-1:], "reasons": []}) is None


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("of 9 published methods that apply, 3 say stiction (a), 6 say no stiction (b)", Votes(3, 6)),
        ("of 2 published methods that apply, none says stiction, 2 say neither (a, b)", Votes(0, 0)),
        ("none of the published methods applies to this record", None),
    ],
)
def test_votes_of_an_older_release_are_read_out_of_their_sentence(text, found):
    assert votes({"reasons": [{"code": "published_methods", "text": text}]}) == found
    assert votes({"reasons": []}) is None
