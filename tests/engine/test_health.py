"""The health number is 100 less what its parts say, and unknown figures take nothing off."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.health import WEIGHTS, health
from app.engine.judgement import Judgement
from app.engine.key_figures import compute
from app.engine.oscillation import Oscillation
from app.engine.recording import Recording

STILL = compute(Recording("x", np.arange(300.0), np.full(300, 5.0), np.full(300, 50.0)))
STICKY = Judgement("stiction", 1.0, "reliable", (), "stiction")
SWING = Oscillation(60.0, 9.0, 0.5, 60.0, 5.0, "pv", 0.0)


def lost(found) -> dict[str, float]:
    return {part.code: part.lost for part in found.parts}


def test_parts_and_number_agree():
    figures = replace(
        STILL, service_factor_pct=40.0, op_saturation_pct=25.0, error_abs_mean_pct_of_span=1.0, good_share_pct=80.0
    )
    found = health(STICKY, figures, SWING)
    assert lost(found) == {
        "stiction": 40.0, "oscillation": 10.0, "service": 9.0, "saturation": 5.0, "tracking": 2.0, "data": 1.0,
    }  # fmt: skip
    assert found.value == pytest.approx(100.0 - sum(part.lost for part in found.parts)) == 33.0


def test_weights_are_a_hundred_together():
    assert sum(WEIGHTS.values()) == 100.0


@pytest.mark.parametrize(
    ("judgement", "points"),
    [
        (Judgement("stiction", 0.5, "reliable", (), None), 20.0),
        (Judgement("stiction", 0.5, "not_reliable", (), None), 12.0),
        (Judgement("not_auditable", None, "not_reliable", (), None), 20.0),
        (Judgement("no_stiction", 0.0, "reliable", (), None), 0.0),
    ],
)
def test_stiction_counts_by_its_probability_and_its_reliability(judgement, points):
    assert lost(health(judgement, STILL, None))["stiction"] == points


def test_a_pv_that_never_answers_is_worse_than_a_valve_that_sticks():
    dead = Judgement("inconclusive", 0.6, "not_reliable", (), "stuck_valve_or_dead_transmitter")
    figures = replace(STILL, service_factor_pct=100.0)
    found = health(dead, figures, None)
    assert (lost(found)["stiction"], lost(found)["service"]) == (40.0, 15.0)
    assert found.value == pytest.approx(100.0 - sum(part.lost for part in found.parts))
    assert found.value < health(STICKY, figures, None).value


def test_a_flat_pv_without_a_controller_at_work_is_neither_good_nor_bad():
    flat = Judgement("not_auditable", None, "not_reliable", (), "stuck_valve_or_dead_transmitter")
    assert lost(health(flat, replace(STILL, service_factor_pct=100.0), None))["stiction"] == 20.0
    assert lost(health(flat, replace(STILL, service_factor_pct=100.0), None))["service"] == 0.0


def test_what_is_not_known_takes_nothing_off_and_says_so():
    found = health(Judgement("no_stiction", 0.0, "reliable", (), None), STILL, None)
    assert found.value == 100.0
    texts = {part.code: part.text for part in found.parts}
    assert texts["service"] == "the mode was not recorded"
    assert texts["saturation"] == "the span of OP is not known"


def test_an_irregular_oscillation_takes_nothing_off():
    assert lost(health(STICKY, STILL, replace(SWING, regularity=0.5)))["oscillation"] == 0.0
