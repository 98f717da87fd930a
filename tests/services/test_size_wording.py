"""How large stiction is, in words."""

import re
from importlib import import_module
from pathlib import Path

import pytest

from app.services.telling.size_wording import LACKING, NO_SWING, NOT_STUCK, NOT_TOLD, size_in_words

quantify = import_module("app.engine.quantification.quantify")

ROW = {
    "verdict": "stiction",
    "stiction_S": 10.03,
    "stiction_S_low": 5.7,
    "stiction_S_high": 12.78,
    "stiction_S_pct_of_op_range": 79.8,
    "stiction_S_pct_of_span": None,
}


def finding(code: str, outcome: str = "fail") -> dict:
    return {"code": code, "outcome": outcome, "text": "as the engine says", "statistic": 2.8, "threshold": 5.0}


def test_a_size_has_its_interval_and_a_check_in_the_field():
    told = size_in_words(ROW, {})
    assert told.headline == (
        "S = 10.0 units of OP, with 95 % certainty between 5.7 and 12.8; that is 79.8 % of the range that OP covers "
        "(45.3 to 101.7 %)."
    )
    assert "by less than 5.7 units" in told.lines[-1]
    assert "by more than 12.8" in told.lines[-1]


def test_size_and_interval_have_equal_digits():
    row = ROW | {"stiction_S": 9.4, "stiction_S_low": 5.81, "stiction_S_high": 13.0}
    assert "S = 9.40 units of OP, with 95 % certainty between 5.81 and 13.00;" in size_in_words(row, {}).headline


def test_the_span_of_op_is_named_where_it_is_known():
    assert "that is 11.2 % of OP's span" in size_in_words(ROW | {"stiction_S_pct_of_span": 11.2}, {}).headline


def test_a_record_without_a_range_has_no_share():
    assert size_in_words(ROW | {"stiction_S_pct_of_op_range": None}, {}).headline.endswith("between 5.7 and 12.8.")


@pytest.mark.parametrize("verdict", NOT_STUCK)
def test_no_size_where_the_valve_is_not_said_to_stick(verdict):
    assert size_in_words(ROW | {"verdict": verdict, "stiction_S": None}, {}).headline == NOT_STUCK[verdict]


@pytest.mark.parametrize("verdict", ["stiction", "inconclusive"])
def test_what_the_record_lacks_is_said(verdict):
    size = {"findings": [finding("size_cycles"), finding("size_width", "pass"), finding("size_new")]}
    told = size_in_words(ROW | {"verdict": verdict, "stiction_S": None}, {"stiction_size": size})
    assert told.headline == NOT_TOLD
    assert told.lines == ("the record holds only 2.8 cycles, at least 5 are needed", "as the engine says")


@pytest.mark.parametrize("detail", [{}, {"stiction_size": None}])
def test_a_loop_that_does_not_swing_has_no_size(detail):
    assert size_in_words(ROW | {"stiction_S": None}, detail).headline == NO_SWING


def test_every_check_of_the_engine_has_its_words():
    source = Path(quantify.__file__).read_text(encoding="utf-8")
    assert set(re.findall(r'"(size_\w+)"', source)) == set(LACKING)


def test_an_op_between_nought_and_one_may_be_a_fraction_of_its_span():
    row = ROW | {"stiction_S": 0.0994, "stiction_S_low": 0.09, "stiction_S_high": 0.11}
    (told,) = size_in_words(row, {"op_ends": [0.21, 0.87]}).lines[3:]
    assert "S is 9.9 % of the span" in told
    for ends, stated in (([0.21, 1.87], None), ([-0.1, 0.9], None), (None, None), ([0.21, 0.87], 9.94)):
        assert len(size_in_words(row | {"stiction_S_pct_of_span": stated}, {"op_ends": ends}).lines) == 3
