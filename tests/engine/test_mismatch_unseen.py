"""What is said of names where the stretch that no fit has seen speaks against them."""

import numpy as np
import pytest

from app.engine.mismatch.conclude import held_out_worse
from app.engine.mismatch.holdout import FitMeasures, Unseen, judge
from app.engine.mismatch.result import Effect, Improvement

NAMED = Effect("valve.deadband", ("valve.stiction",), 0.9, "valve", (), (), "after OP reversals", (), 40.0)


def improved(refitted: float, explained: float) -> Improvement:
    return Improvement(None, FitMeasures(refitted, 0.0), FitMeasures(explained, 0.0), ())


@pytest.mark.parametrize(
    ("error", "beside_load", "gain", "ran_worse", "why"),
    [
        (1.2, 1.2, -1.0, [True, False, True, False, False], "2 of 5 stretches"),
        (1.2, 0.25, -1.0, [False], "is 0.25 there, and 1 without"),
        (1.2, 1.2, 7.0, [False], "better, by 7.0 points of log-likelihood"),
        (1.02, 1.02, -1.0, [False], "noise"),
    ],
)
def test_names_that_stand_beside_a_worse_free_run_say_so(
    error: float, beside_load: float, gain: float, ran_worse: list[bool], why: str
) -> None:
    (said,) = held_out_worse(
        (NAMED,), improved(1.0, error), Unseen(1.0, beside_load, beside_load < 1.0), gain, ran_worse
    )
    assert said.code == "held_out_worse"
    assert f"from 1 to {error:.4g}" in said.text
    assert "valve.deadband or valve.stiction" in said.text
    assert why in said.text


@pytest.mark.parametrize(("effects", "error"), [((NAMED,), 0.9), ((NAMED,), float("nan")), ((), 1.2)])
def test_nothing_is_said_where_nothing_is_worse_or_named(effects: tuple[Effect, ...], error: float) -> None:
    assert held_out_worse(effects, improved(1.0, error), Unseen(1.0, error), 1.0, [False]) == ()


@pytest.mark.parametrize("level", [0.0, 50.1, 1000.3])
def test_a_pv_that_stands_has_no_fit(level: float) -> None:
    """The deviation of equal values from their mean is rounding: a hundred million million per cent of it is no fit."""
    pv = np.full(450, level)
    found = judge(pv, pv + 0.01, np.ones(450, dtype=np.bool_))
    assert found.rmse == pytest.approx(0.01)
    assert np.isnan(found.fit_pct)
