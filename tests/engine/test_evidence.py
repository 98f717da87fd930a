"""Evidence is data: a statistic, an operator, a threshold, and whether it holds."""

import pytest

from app.engine.evidence import Finding, Measured, Reason, in_digits, reason_of
from app.engine.verdict.wording import figure


@pytest.mark.parametrize(
    ("operator", "below", "at", "above"),
    [("<", True, False, False), ("<=", True, True, False), (">", False, False, True), (">=", False, True, True)],
)
def test_what_is_measured_holds_or_not(operator, below, at, above):
    assert [Measured(value, operator, 5.0).passed for value in (4.9, 5.0, 5.1)] == [below, at, above]


def test_a_finding_keeps_its_figures_as_a_reason():
    short = Finding("too_short", "fail", "90 samples", 90.0, 100.0, "samples", ">=")
    assert reason_of(short) == Reason("too_short", "90 samples", Measured(90.0, ">=", 100.0))
    weighed = Finding("gaps", "fail", "two holes", 2.0, None, "holes")
    assert reason_of(weighed) == Reason("gaps", "two holes", None)


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("sticking", 0.6, "60 %"),
        ("gain", -0.123, "0.88"),
        ("pv_quantum", 0.0234, "0.023"),
        ("pv_quantum", 7.6e13, "7.6e+13"),
        ("op_triangle", 0.4, None),
    ],
)
def test_a_value_is_told_as_the_sentences_of_its_feature_tell_it(name, value, told):
    assert figure(name, value) == told


@pytest.mark.parametrize(
    ("value", "told"), [(0.0234, "0.023"), (2.24, "2.2"), (17.4, "17"), (99.4, "99"), (99.7, "100"), (120.3, "120")]
)
def test_a_large_number_is_told_without_an_exponent(value, told):
    assert in_digits(value, 2) == told
    assert in_digits(-value, 2) == f"-{told}"
