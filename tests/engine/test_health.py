"""The health number is 100 less what its parts say, and unknown figures take nothing off."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.audit import audit
from app.engine.evidence import Reason
from app.engine.health import WEIGHTS, health
from app.engine.judgement import Judgement
from app.engine.key_figures import compute
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import Recording, UniformRecord

STILL = compute(Recording("x", np.arange(300.0), np.full(300, 5.0), np.full(300, 50.0)))
STICKY = Judgement("stiction", 1.0, "reliable", (), "stiction")
IN_MANUAL = np.zeros(900, dtype=bool)
SWING = Oscillation(60.0, 9.0, 0.6, 60.0, 5.0, "pv", 0.0)


def lost(found) -> dict[str, float]:
    return {part.code: part.lost for part in found.parts}


def test_parts_and_number_agree():
    figures = replace(
        STILL, service_factor_pct=40.0, op_saturation_pct=25.0, error_abs_mean_pct_of_span=1.0, good_share_pct=80.0
    )
    found = health(STICKY, figures, SWING)
    assert lost(found) == {
        "stiction": 40.0, "oscillation": 12.0, "service": 9.0, "saturation": 5.0, "tracking": 2.0, "data": 1.0,
    }  # fmt: skip
    assert found.value == pytest.approx(100.0 - sum(part.lost for part in found.parts)) == 31.0


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


def test_a_pv_that_does_not_answer_is_as_bad_where_that_keeps_from_a_verdict():
    flat = Judgement("not_auditable", None, "not_reliable", (), "stuck_valve_or_dead_transmitter")
    dead = Judgement("inconclusive", 0.6, "not_reliable", (), "stuck_valve_or_dead_transmitter")
    in_automatic = replace(STILL, service_factor_pct=100.0)
    assert lost(health(flat, in_automatic, None)) == lost(health(dead, in_automatic, None))
    assert lost(health(flat, STILL, None))["stiction"] == 40.0
    assert lost(health(flat, STILL, None))["service"] == 0.0  # whether a controller works against it is not known


def test_what_is_not_known_takes_nothing_off_and_says_so():
    found = health(Judgement("no_stiction", 0.0, "reliable", (), None), STILL, None)
    assert found.value == 100.0
    texts = {part.code: part.text for part in found.parts}
    assert texts["service"] == "the mode was not recorded"
    assert texts["saturation"] == "the span of OP is not known"


def resting_at_its_least(share: float) -> np.ndarray:
    n = 1000
    ramp = np.linspace(50.0, 0.0, n - round(share * n), endpoint=False)
    return np.concatenate([ramp, np.zeros(n - len(ramp))])


@pytest.mark.parametrize(("share", "points"), [(0.1, 0.0), (0.25, 5.0), (0.6, 10.0)])
def test_without_a_span_of_op_its_own_extremes_are_asked(share, points):
    op = resting_at_its_least(share)
    figures = compute(Recording("x", np.arange(1000.0), np.sin(np.arange(1000.0)), op))
    assert figures.op_saturation_pct is None
    assert lost(health(STICKY, figures, None))["saturation"] == points
    known = compute(Recording("x", np.arange(1000.0), np.sin(np.arange(1000.0)), op - 20.0, op_range=(-50.0, 50.0)))
    assert known.op_at_extreme_pct is None
    assert lost(health(STICKY, known, None))["saturation"] == 0.0


def test_an_op_of_few_values_has_no_extremes_that_say_anything():
    figures = compute(Recording("x", np.arange(1000.0), np.sin(np.arange(1000.0)), np.arange(1000.0) % 2))
    assert figures.op_at_extreme_pct is None


def test_a_record_that_shows_nothing_of_a_valve_is_not_a_healthy_valve():
    nothing = Judgement("inconclusive", 0.05, "not_reliable", (Reason("uncoupled", "of two loops"),), None)
    assert lost(health(nothing, STILL, None))["stiction"] == 20.0


@pytest.mark.parametrize(("samples", "code"), [(3, "too_short"), (3000, "missing_values")])
def test_too_little_data_is_no_health_neither_a_good_one_nor_a_bad_one(samples, code):
    pv = np.full(samples, np.nan)
    pv[:3] = (1.0, 2.0, 3.0)
    found = audit(Recording("x", np.arange(float(samples)), pv, np.cos(np.arange(float(samples)))))
    assert [reason.code for reason in found.judgement.reasons] == [code]
    assert found.health.value is None
    told = f"not evaluated, because too little was measured: {found.judgement.reasons[0].text}"
    assert found.health.not_evaluated == told
    assert [(part.code, part.lost, part.text) for part in found.health.parts] == [(code, 0.0, told) for code in WEIGHTS]


def test_a_refused_record_with_enough_in_it_has_a_health():
    manual = audit(
        Recording("x", np.arange(900.0), np.sin(np.arange(900.0)), np.arange(900.0) % 7, automatic=IN_MANUAL)
    )
    assert manual.judgement.verdict == "not_auditable"
    assert (manual.health.value, manual.health.not_evaluated) == (65.0, None)


@pytest.mark.parametrize(("probability", "told"), [(0.001, "under 0.01"), (0.25, "0.25"), (0.999, "over 0.99")])
def test_no_probability_is_told_as_certain(probability, told):
    (part, *_) = health(Judgement("no_stiction", probability, "reliable", (), None), STILL, None).parts
    assert part.text == f"probability of stiction {told}"


def test_an_irregular_oscillation_takes_nothing_off():
    assert lost(health(STICKY, STILL, replace(SWING, regularity=0.5)))["oscillation"] == 0.0


@pytest.mark.parametrize(("strength", "points"), [(0.29, 0.0), (0.3, 0.0), (0.45, 4.5), (0.6, 12.0), (1.0, 20.0)])
def test_what_noise_shows_takes_nothing_off(strength, points):
    part = health(STICKY, STILL, replace(SWING, strength=strength)).parts[1]
    assert part.lost == points
    assert part.text.startswith("no oscillation beyond what noise shows" if points == 0.0 else "oscillates with")


def test_healthy_loops_under_a_load_that_wanders_keep_their_health():
    rng, taken_off = np.random.default_rng(3), []
    for _ in range(20):
        pv, op = lfilter([1.0], [1.0, -0.9], rng.standard_normal((2, 2000)))
        found = detect(UniformRecord(1.0, pv, op, None, np.zeros(2000, bool)))
        taken_off.append(health(STICKY, STILL, found).parts[1].lost)
    assert np.quantile(taken_off, 0.9) == 0.0


@pytest.mark.parametrize(("period_s", "told"), [(0.0237, "0.0237"), (9.87, "9.87"), (45.3, "45"), (86400.0, "86400")])
def test_a_period_is_told_of_quick_loops_too(period_s, told):
    part = health(STICKY, STILL, replace(SWING, period_s=period_s)).parts[1]
    assert part.text == f"oscillates with a period of {told} s, strength 0.60"
