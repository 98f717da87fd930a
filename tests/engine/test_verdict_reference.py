"""The published rule as a verdict: what decides, and which way the evidence moves the probability."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.engine.reference.published_rule import READINGS, judge, rmse_gain


def curve(*rmse: float) -> SimpleNamespace:
    """An RMSE curve over d = 0, 0.1, 0.2, ..."""
    d = 0.1 * np.arange(len(rmse))
    best = int(np.argmin(rmse))
    none = np.full(len(rmse), np.nan)
    return SimpleNamespace(d=d, rmse=np.array(rmse), rmse_refined=none, best=best, d_best=d[best], stiction=best > 0)


def reference(one: SimpleNamespace, yper_pct: float = 12.0, **changed) -> SimpleNamespace:
    reading = f"{'high' if yper_pct > 0.5 else 'low'}_{'stiction' if one.stiction else 'no_stiction'}"
    last = SimpleNamespace(one=one, two=changed.pop("two", None), stiction=one.stiction)
    parts = {
        "last": last,
        "yper": SimpleNamespace(yper_pct=yper_pct),
        "reading": reading,
        "reliable": reading in ("high_stiction", "low_no_stiction"),
        "widenings": 0,
        "ending": "agreement",
    }
    return SimpleNamespace(**(parts | changed))


@pytest.mark.parametrize(
    ("rmse", "yper_pct", "verdict", "reliability", "first_reason"),
    [
        ((1.0, 0.9, 1.1), 12.0, "stiction", "reliable", "yper_high_stiction"),
        ((1.0, 0.9, 1.1), 0.2, "stiction", "not_reliable", "yper_low_stiction"),
        ((1.0, 1.1, 1.2), 12.0, "no_stiction", "not_reliable", "yper_high_no_stiction"),
        ((1.0, 1.1, 1.2), 0.2, "no_stiction", "reliable", "yper_low_no_stiction"),
    ],
)
def test_table_2(rmse, yper_pct, verdict, reliability, first_reason):
    judgement = judge(reference(curve(*rmse), yper_pct))
    assert (judgement.verdict, judgement.reliability) == (verdict, reliability)
    assert judgement.reasons[0].code == first_reason
    assert judgement.likely_cause == ("stiction" if verdict == "stiction" else None)


def test_reasons_tell_the_climb_and_a_second_opinion():
    one = curve(1.0, 1.1)
    two = SimpleNamespace(stiction=True)
    codes = [reason.code for reason in judge(reference(one, two=two, widenings=3)).reasons]
    assert codes == [
        "yper_high_no_stiction",
        "rmse_least_without_stiction",
        "two_parameter_disagrees",
        "search_space_widened",
        "reference_only",
    ]


@pytest.mark.parametrize(
    ("yper_pct", "widenings", "told"),
    [
        (12.0, 3, "the search space was widened 3 times; the last one did not agree either"),
        (0.2, 1, "the search space was widened once; agreement was found"),
    ],
)
def test_how_the_climb_ended_is_told(yper_pct, widenings, told):
    reasons = judge(reference(curve(1.0, 1.1), yper_pct, widenings=widenings)).reasons
    assert told in [reason.text for reason in reasons]


@pytest.mark.parametrize("alike", [curve(1.0, 1.1), curve(1.0, 0.9)])
def test_a_second_opinion_that_agrees_is_not_told(alike):
    codes = [reason.code for reason in judge(reference(alike, two=SimpleNamespace(stiction=alike.stiction))).reasons]
    assert "two_parameter_disagrees" not in codes


@pytest.mark.parametrize(
    ("ending", "told"),
    [
        ("record_too_short", ["record_too_short_to_widen"]),
        ("not_widened", ["search_space_not_widened"]),
        ("agreement", []),
    ],
)
def test_why_the_search_space_was_not_widened_is_told(ending, told):
    reasons = judge(reference(curve(1.0, 1.1), ending=ending)).reasons
    assert [reason.code for reason in reasons if "widen" in reason.code] == told


def test_every_reading_has_its_sentence():
    assert set(READINGS) == {f"{a}_{b}" for a in ("high", "low") for b in ("stiction", "no_stiction")}


@pytest.mark.parametrize(
    ("rmse", "gain"),
    [
        ((1.0, 0.8, 0.9), 0.2),
        ((1.0, 1.5, 1.25), -0.25),
        ((1.0, np.nan, 0.5), 0.5),
        ((1.0, np.nan), 0.0),
        ((0.0, 1.0), 0.0),
    ],
)
def test_rmse_gain(rmse, gain):
    assert rmse_gain(curve(*rmse)) == pytest.approx(gain)


def test_gain_compares_refined_with_refined():
    one = curve(1.0, 0.9, 0.95)
    one.rmse_refined = np.array([0.8, 0.84, np.nan])
    assert rmse_gain(one) == pytest.approx(-0.05)


rmses = st.lists(st.floats(1e-6, 1e6), min_size=2, max_size=6)
ypers = st.floats(0.0, 100.0)


@given(rmses, ypers)
def test_probability_is_on_the_side_of_the_verdict(rmse, yper_pct):
    judgement = judge(reference(curve(*rmse), yper_pct))
    assert 0.0 < judgement.stiction_probability < 1.0
    assert (judgement.stiction_probability > 0.5) == (judgement.verdict == "stiction")


@given(rmses, ypers, ypers)
def test_probability_does_not_fall_with_yper(rmse, low, high):
    low, high = sorted((low, high))
    one = curve(*rmse)
    assert judge(reference(one, low)).stiction_probability <= judge(reference(one, high)).stiction_probability


@given(st.floats(0.1, 2.0), st.floats(0.1, 2.0), ypers)
def test_probability_does_not_fall_with_the_gain_of_the_valve_model(less, more, yper_pct):
    better, worse = sorted((less, more))
    p_better = judge(reference(curve(1.0, better), yper_pct)).stiction_probability
    p_worse = judge(reference(curve(1.0, worse), yper_pct)).stiction_probability
    assert p_better >= p_worse
