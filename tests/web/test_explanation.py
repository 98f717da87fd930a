"""The part of a loop's page about what a simulation lacks: every state, and the button that asks."""

import re

import pytest

from app.services.explaining.wording import (
    HELD,
    LEFT,
    NO_SIZE,
    RANGES,
    SAME_HELD_OUT,
    effect_in_words,
    effect_words,
    errors,
    left_in_words,
    loops,
    parameters_in_words,
    residuals_in_words,
    unmoved,
    windows_in_words,
)
from app.services.moments import UTC_CLOCK
from app.web.rendering import page

HOSTILE = 'A/<script>alert(1)</script>"'
ASKED = {
    "id": "7",
    "loop": HOSTILE,
    "state": "open",
    "asked_at": "2026-01-01T00:00:00Z",
    "audit_id": None,
    "located": None,
    "waits_for_room_since": None,
}
DONE = ASKED | {
    "state": "done",
    "verdict": "missing_physics",
    "named": True,
    "verdict_words": "physics is missing from the simulation",
    "window_start": "2026-01-01T00:00:00Z",
    "window_end": "2026-01-01T01:00:00Z",
    "as_judged": False,
    "remarks": [],
    "simulation_words": "a given model",
    "audit_id": "3",
    "told_effects": [
        {
            "code": "disturbance.coupling",
            "words": "another signal moves PV",
            "alternatives": ["the gain drifts"],
            "probability": 0.93,
            "block": "disturbance",
            "condition": "when <b>X</b> moves",
            "parameters": ["gain = 0.5 PV/X (0.4 to 0.6)"],
            "no_size": "",
            "windows": "0-10 s",
            "reasons": ["because"],
        }
    ],
    "errors": [("as given", "1.2", "40", "no (p < 0.001)", "yes (p 0.4)")],
    "loops": [("recorded", "120", "1.4", "3.1", "0.87"), ("simulation as given", "none", "0.2", "8.0", "0.90")],
    "reasons": ["the controller works as it should"],
    "ranges": f"{RANGES}: {HELD}.",
    "unmoved": [],
}


def part(explanation: dict | None) -> str:
    return page("_explanation.html", UTC_CLOCK, tag=HOSTILE, explanation=explanation).body.decode()


@pytest.mark.parametrize(
    ("explanation", "words"),
    [
        (None, "has been compared"),
        (ASKED, "In progress; requested at 2026-01-01 00:00 UTC"),
        (ASKED | {"located": {"block": "valve", "condition": "after OP reversals"}}, "differ at the valve, after OP"),
        (
            ASKED | {"located": {"block": None, "condition": "nowhere"}},
            "First answer: no place stands out at a first look",
        ),
        (
            ASKED | {"waits_for_room_since": "2026-01-01T01:00:00Z"},
            "Since 2026-01-01 01:00 there is no room on the disk to keep its answer",
        ),
        (ASKED | {"state": "failed", "error_code": "time_limit", "error_text": "too long"}, "too long (time_limit)"),
        (DONE, "01:00 UTC, against a given model; requested by run 3"),
        (
            DONE | {"as_judged": True},
            "01:00 UTC, the part of a long record that its audit judges, against a given model",
        ),
        (DONE | {"remarks": ["This is from before the repair."]}, "<b>This is from before the repair.</b>"),
    ],
)
def test_every_state_is_told(explanation: dict | None, words: str) -> None:
    html = part(explanation)
    assert words in re.sub(r"\s+", " ", html)
    assert "<script" not in html


def test_what_comes_from_the_plant_is_escaped() -> None:
    html = part(DONE)
    assert "when &lt;b&gt;X&lt;/b&gt; moves" in html
    assert 'data-url="/v1/loops/A%2F%3Cscript%3Ealert%281%29%3C%2Fscript%3E%22/explanations/7/plot"' in html


def test_tests_of_the_residuals_and_the_loop_closed_again_are_shown() -> None:
    html = re.sub(r"\s+", " ", part(DONE))
    assert "A pattern left beside its noise" in html
    assert "no (p &lt; 0.001)" in html
    assert 'simulation as given</td><td class="number" data-label="Period, s">none</td>' in html
    assert "Loop closed again" not in part(DONE | {"loops": []})


def test_what_speaks_for_an_effect_is_one_sentence_of_several_parts() -> None:
    effect = DONE["told_effects"][0] | {"reasons": ["adds 42 points", "the next candidate is 30 behind"]}
    said = "adds 42 points; the next candidate is 30 behind"
    assert f'<td class="why">{said}</td>' in part(DONE | {"told_effects": [effect]})
    assert f"<p>{said}.</p>" in part(DONE | {"unmoved": effect["reasons"]})


def test_words_for_residuals_and_loops() -> None:
    white = {"statistic": 12.0, "limit": 31.4, "p": 0.62, "lags": 20}
    owing = {"statistic": 96.0, "limit": 31.4, "p": 1e-9, "lags": 20}
    fit = {"residuals": {"given": None, "refitted": {"whiteness": white, "independence": owing}}}
    assert residuals_in_words(fit, "refitted") == ("none seen (p 0.62)", "yes (p < 0.001)")
    assert residuals_in_words(fit, "given") == residuals_in_words({}, "explained") == ("–", "–")
    figures = {"period_s": None, "amplitude": 1.4, "yper_pct": 3.0, "shape": 0.9}
    assert loops({"recorded": figures, "explained": None}) == [("recorded", "–", "1.4", "3", "0.9")]
    assert loops(None) == []


def test_a_named_effect_that_the_unseen_stretch_does_not_hold_says_so() -> None:
    effect = {"effect": "sensor.stuck", "windows": [[0.0, 10.0]]}
    fit = {"rmse_refitted": 0.361, "rmse_explained": 0.3611, "held_out": [[20.0, 50.0]]}
    (told,) = unmoved(fit, [effect])
    assert told.startswith("sensor.stuck does not act in the stretch")
    assert unmoved(fit, [effect | {"windows": [[0.0, 30.0]]}]) == [SAME_HELD_OUT]
    assert unmoved(fit | {"rmse_explained": 0.3}, [effect]) == unmoved(fit, []) == []


def test_what_is_left_is_told_with_whose_it_is() -> None:
    white = {"statistic": 12.0, "limit": 31.4, "p": 0.62, "lags": 20}
    fit = {"residuals": {"given": {"whiteness": white, "independence": None}}}
    told = left_in_words(fit, {"given": "the given model", "refitted": "our own", "explained": None})
    assert told == [LEFT, "given: the given model; pattern: none seen (p 0.62), OP in it: –", "refitted: our own"]
    assert left_in_words({"residuals": {}}, {"refitted": "our own"}) == ["refitted: our own"]


def test_words_for_effects_parameters_and_windows() -> None:
    assert effect_words("valve.stiction") == "the valve sticks"
    assert effect_words("valve.new_thing") == "valve: new thing"
    told = {
        "S": {"value": 4.1, "low": 3.9, "high": 4.3, "unit": "OP"},
        "start": {"value": 20, "low": 20, "high": 20, "unit": "s"},
    }
    assert parameters_in_words(told) == ["S = 4.1 OP (3.9 to 4.3)", "start = 20 s (no interval)"]


def test_a_signal_that_is_read_from_the_right_keeps_its_place_in_what_is_said() -> None:
    gain = {"value": 2.0, "low": 1.0, "high": 3.0, "unit": "PV/\u05d7\u05dd"}
    told = effect_in_words(
        {
            "effect": "disturbance.coupling",
            "alternatives": [],
            "probability": 0.9,
            "block": "disturbance",
            "condition": "when \u05d7\u05dd moves",
            "parameters": {"gain": gain},
            "windows": [],
            "evidence": [{"code": "c", "text": "\u05d7\u05dd (0.9)"}],
        },
        None,
        UTC_CLOCK,
    )
    assert told["condition"] == "when \u2068\u05d7\u05dd\u2069 moves"
    assert told["parameters"] == ["gain = 2 \u2068PV/\u05d7\u05dd\u2069 (1 to 3)"]
    assert told["reasons"] == ["\u2068\u05d7\u05dd\u2069 (0.9)"]


def test_a_size_whose_interval_holds_zero_says_so_but_not_a_part_of_a_wave() -> None:
    change = {"value": 0.5, "unit": "share of gain", "low": -0.4, "high": 1.4}
    cosine = {"value": -0.1, "unit": "PV", "low": -0.2, "high": 0.03}
    said = parameters_in_words({"change": change, "cosine": cosine})
    assert said == ["change = 0.5 share of gain (-0.4 to 1.4; it may be zero)", "cosine = -0.1 PV (-0.2 to 0.03)"]
    assert windows_in_words([[0, 10], [20, 30]], None, UTC_CLOCK) == "0–10 s, 20–30 s"
    assert windows_in_words([[k, k + 1] for k in range(6)], None, UTC_CLOCK).endswith("3–4 s and 2 more")


def test_a_fitted_stiction_says_that_it_is_no_size():
    effect = {
        "effect": "valve.stiction",
        "alternatives": [],
        "probability": 0.9,
        "block": "valve",
        "condition": "always",
        "parameters": {"S": {"value": 13.8, "low": 13.8, "high": 13.8, "unit": "OP"}},
        "windows": [],
        "evidence": [],
    }
    told = effect_in_words(effect, None, UTC_CLOCK)
    assert (told["parameters"], told["no_size"]) == (["S = 13.8 OP (no interval)"], NO_SIZE)
    assert effect_in_words(effect | {"effect": "sensor.drift"}, None, UTC_CLOCK)["no_size"] == ""
    html = part(DONE | {"told_effects": [told | {"no_size": NO_SIZE}]})
    assert "<summary>of the model, not the size</summary>S = 13.8 OP" in html
    assert "in 34 of 35 simulated loops" in html


def test_its_wide_tables_are_scrolled_by_keyboard_and_have_names():
    html = part(DONE)
    assert html.count('<div class="wide" tabindex="0" role="group" aria-label="') == html.count('class="wide"') == 3


def test_where_nothing_is_missing_no_simulation_has_the_missing_physics() -> None:
    fit = {f"{kind}_{name}": 1.0 for kind in ("rmse", "fit_pct") for name in ("given", "refitted", "explained")}
    assert [words for words, *_ in errors(fit, any_named=True)][-1] == "with the missing physics"
    assert [words for words, *_ in errors(fit, any_named=False)][-1] == "as explained: no effect is named"
