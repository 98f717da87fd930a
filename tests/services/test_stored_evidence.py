"""What verdicts measured is read as data, and out of the sentences of releases that stored nothing else."""

from types import SimpleNamespace

import pytest

from app.engine.verdict.wording import WORDED, is_spoken, sentence
from app.services.moments import PlantClock
from app.services.plant.evidence_moved import moved
from app.services.telling.older_sentences import older_sentence
from app.services.telling.stored_evidence import (
    Explained,
    Shape,
    Votes,
    band_of,
    began_at,
    explained,
    shapes,
    votes,
)

STANDS = '{"measured":{"shape_sticking":[0.6,">",0.2],"shape_op_kurtosis":[-1.2,"<",0.1],"few_cycles":[3.0,">=",5.0]}}'
CLEARED = '{"measured":{"shape_sticking":[0.08,">",0.2],"shape_op_kurtosis":[2.4,"<",0.1]}}'
CODES = "shape_sticking;shape_op_kurtosis;few_cycles"


def test_shapes_are_told_from_what_is_stored_whatever_the_sentences_say():
    found = shapes(CODES, "one. two. three", STANDS)
    assert found == {
        "shape_sticking": Shape(
            "PV stands still while OP moves, then follows it, for 60 % of the time", "60 %", 0.6, True
        ),
        "shape_op_kurtosis": Shape(
            "OP is distributed like a triangle wave or a sine, not like noise", None, None, True
        ),
    }
    assert shapes(CODES, "", CLEARED)["shape_sticking"] == Shape(
        "PV hardly ever stands still while OP moves and then follows it (8 % of the time)", "8 %", 0.08, False
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


SIDES = [(name, side) for name in sorted(WORDED) for side in (True, False) if is_spoken(name, side)]


def told_side(name, text):
    return shapes(f"shape_{name}", text, "{}")[f"shape_{name}"].for_stiction


@pytest.mark.parametrize(("name", "side"), SIDES)
def test_the_side_of_a_shape_is_known_by_its_sentence_of_this_release_and_of_the_one_before(name, side):
    assert told_side(name, sentence(name, side, 0.37)) is side
    before = older_sentence(name, side)
    assert before is None or told_side(name, before.replace("0 %", "37 %").replace("0 of", "-0.42 of")) is side


@pytest.mark.parametrize(
    ("name", "text", "found"),
    [
        ("flat_eighth", "64 % of the travel of OP finds PV standing still", ("64 %", 0.64, True)),
        ("flat_eighth", "PV stands still during 64 % of OP's travel", ("64 %", 0.64, True)),
        ("ccf_odd", "OP and PV run in quadrature (odd part of their cross-correlation 0.81)", ("0.81", 0.81, True)),
        ("ccf_odd", "OP and PV are in quadrature (odd part of their cross-correlation 0.81)", ("0.81", 0.81, True)),
        ("op_kurtosis", "OP is spread like noise", (None, None, False)),
        ("op_kurtosis", "OP is distributed like noise", (None, None, False)),
    ],
)
def test_a_shape_is_read_out_of_the_sentences_of_both(name, text, found):
    assert shapes(f"shape_{name}", text, None) == {f"shape_{name}": Shape(text, *found)}


@pytest.mark.parametrize(
    "text",
    [
        "PV goes as behind a valve that moves only after OP has gone some 1.2 units the other way: it may stick",
        "PV moves as if the valve followed only after OP had reversed by about 1.2 units: it may stick",
    ],
)
def test_a_band_is_read_out_of_the_sentences_of_both(text):
    assert band_of({"reasons_text": text}) == 1.2
    assert band_of({"reasons_text": text, "hidden_band_op": 0.5}) == 0.5


@pytest.mark.parametrize(
    "rest", ["what was recorded before that shows nothing of it", "nothing recorded before that shows it"]
)
def test_when_it_began_is_read_out_of_the_sentences_of_both(rest):
    text = f"few. the valve has been sticking since 2026-03-01 04:00; {rest}"
    assert began_at({"reasons_text": text}, PlantClock("UTC")) == "2026-03-01 04:00"


def changed(now, before):
    told = {"reasons": CODES, "reasons_text": "PV stands 60 %. OP is smooth. few", "extra_json": now}
    told |= {f"{name}_before": value for name, value in told.items()} | {"extra_json_before": before}
    return SimpleNamespace(verdict="stiction", probability=0.99, probability_before=0.1, **told)


def test_what_moved_is_told_in_the_figures_that_are_stored():
    assert moved(changed(STANDS, CLEARED)) == (
        "PV stands still while OP moves, then follows it, for 60 % of the time (8 % before), probability 0.10 -> 0.99"
    )
    assert moved(changed(STANDS, STANDS)).startswith("PV stands still while OP moves, then follows it, for 60 % of the")


@pytest.mark.parametrize(("before", "tells"), [(0.88, True), (0.9, False)])
def test_of_a_probability_that_hardly_moved_no_evidence_is_why(before, tells):
    row = changed(STANDS, CLEARED)
    row.probability_before = before
    assert bool(moved(row)) is tells


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
    now = "run freely on the other, a sticky valve explains 3 % of PV, a linear one 4 %: the shapes point to stiction"
    assert explained({"text": now}) == Explained(3, 4)


def test_votes_are_counted_from_what_each_method_says():
    said = [("stiction", True), ("stiction", True), ("no_stiction", True), (None, True), ("stiction", False)]
    methods = [{"says": says, "applies": applies} for says, applies in said]
    assert votes({"methods": methods, "reasons": []}) == Votes(2, 1)
    assert votes({"methods": methods[-1:], "reasons": []}) is None


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("of 9 published methods that apply, 3 say stiction (a), 6 say no stiction (b)", Votes(3, 6)),
        (
            "of 5 published methods that apply, 1 says stiction, 4 say no stiction; they do not affect the verdict",
            Votes(1, 4),
        ),
        ("of 2 published methods that apply, none says stiction, 2 say neither (a, b)", Votes(0, 0)),
        ("none of the published methods applies to this record", None),
    ],
)
def test_votes_of_an_older_release_are_read_out_of_their_sentence(text, found):
    assert votes({"reasons": [{"code": "published_methods", "text": text}]}) == found
    assert votes({"reasons": []}) is None
