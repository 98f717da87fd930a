"""What to do next follows from verdict, reliability and cause, and stands in the guide in the same words."""

from pathlib import Path
from typing import get_args

import pytest

from app.engine.causality.hidden_band import HiddenBand
from app.engine.codes import UNANSWERED, Cause
from app.engine.long_records.episodes import BEGAN, episode_text
from app.engine.verdict.doubts import band_reason
from app.services.moments import UTC_CLOCK, PlantClock
from app.services.telling import next_steps
from app.services.telling.next_steps import BY_CAUSE, Ask, step_of
from app.services.telling.reason_wording import REASON_WORDS
from app.services.telling.repair_sides import BEFORE_REPAIR
from app.services.telling.wording import CAUSE_WORDS

GUIDE = Path(__file__).parents[2] / "docs" / "guides" / "OPERATOR.md"


def next_step(row: dict[str, object], repaired_at: str | None = None) -> str:
    return next_steps.next_step(row, UTC_CLOCK, repaired_at)


def row_of(verdict: str, reliability: str, likely_cause: str | None) -> dict[str, object]:
    """Of the reliability table, as far as a step asks for it."""
    told = {"verdict": verdict, "reliability": reliability, "likely_cause": likely_cause}
    return {**told, "reasons": ""}


@pytest.mark.parametrize(
    ("row", "told"),
    [
        (("stiction", "reliable", "stiction"), "stroke test"),
        (("stiction", "reliable", "stiction"), "packing, positioner"),
        (("stiction", "not_reliable", "stiction"), "in manual"),
        (("inconclusive", "not_reliable", "stuck_valve_or_dead_transmitter"), "Look today"),
        (("inconclusive", "not_reliable", None), "unless it stays like that for weeks"),
        (("no_stiction", "reliable", "external_oscillation"), "disturbs this loop"),
        (("no_stiction", "reliable", "tight_tuning"), "looser tuning"),
        (("no_stiction", "reliable", None), "Nothing at the valve"),
        (("not_auditable", "not_reliable", "not_in_automatic"), "in manual"),
        (("not_auditable", "not_reliable", None), "better recording"),
    ],
)
def test_a_step_for_each(row, told):
    assert told in next_step(row_of(*row))


def test_a_verdict_of_before_a_repair_sends_nobody_out():
    row = row_of("stiction", "reliable", "stiction")
    assert BEFORE_REPAIR in REASON_WORDS
    assert next_step(row | {"reasons": "before_repair;shape_sticking"}) == Ask.WAIT
    assert next_step(row | {"verdict": "no_stiction", "reasons": "stiction_began"}) == Ask.BEGAN_TO_STICK
    unsure = row | {"verdict": "stiction", "reliability": "not_reliable"}
    assert next_step(unsure | {"reasons": "evidence_not_clear;stiction_began"}) == Ask.BEGAN_TO_STICK
    assert next_step(unsure | {"reliability": "reliable", "reasons": "stiction_began"}) == Ask.STICKS


def test_a_step_carries_the_hour_and_the_band_that_its_reasons_name():
    began = row_of("stiction", "not_reliable", "stiction") | {"reasons": "stiction_began"}
    text = episode_text(BEGAN, 0.9, "2026-11-29 00:22 UTC", "")
    assert "since 2026-11-29 00:22 UTC," in next_step(began | {"reasons_text": text})
    band = row_of("no_stiction", "not_reliable", None) | {"reasons": "hidden_band"}
    (reason,) = band_reason(HiddenBand(1.6, 9.0, 3.0))
    asked = "in steps of 0.4 units (a quarter of the band, 1.6),"
    assert asked in next_step(band | {"reasons_text": "worded otherwise", "hidden_band_op": 1.6})
    assert asked in next_step(band | {"reasons_text": reason.text})  # a row of before that number


def test_the_hour_is_the_one_that_is_stored_whatever_the_sentence_says():
    began = row_of("stiction", "not_reliable", "stiction") | {"reasons": "stiction_began"}
    stored = {"episode_start": "2026-11-28T23:22:00Z", "reasons_text": "worded otherwise"}
    assert "since 2026-11-29 00:22 UTC+01:00," in step_of(began | stored, PlantClock("Europe/Berlin")).text


def test_what_a_step_says_of_one_loop_is_told_apart():
    row = row_of("stiction", "not_reliable", "stiction") | {"reasons": "stiction_began;few_cycles"}
    row |= {"oscillation_period_s": 2067.0, "episode_start": "2026-11-29T00:22:00Z"}
    step = step_of(row, UTC_CLOCK)
    assert (step.code, step.asks) == ("began_to_stick", Ask.BEGAN_TO_STICK)
    assert step.besides == "a longer record will tell more: 5 cycles of this loop take 2.9 h"
    assert step.text.endswith(
        "ask for a stroke test. A longer record will tell more: 5 cycles of this loop take 2.9 h."
    )
    sure = step_of(row_of("stiction", "reliable", "stiction"), UTC_CLOCK)
    assert (sure.asks, sure.text, sure.besides) == (Ask.STICKS, Ask.STICKS, "")


def test_what_leaves_the_valve_alone_is_told_by_its_code():
    assert {ask for ask in Ask if ask.startswith("Nothing")} == next_steps.NOTHING


def test_every_cause_has_words_and_a_step():
    no_engine_says = {"data"}
    assert set(CAUSE_WORDS) - no_engine_says == set(get_args(Cause))
    assert set(BY_CAUSE) == set(CAUSE_WORDS) - {"stiction"}


def test_the_guide_says_the_same():
    assert next_steps.as_table() in GUIDE.read_text(encoding="utf-8")


def test_what_does_not_clear_a_valve_does_not_read_as_cleared():
    unsure = row_of("no_stiction", "not_reliable", None)
    assert next_step(unsure | {"reasons": "few_cycles"}) == Ask.NOT_CLEARED
    assert next_step(unsure | {"likely_cause": "disturbance", "reasons": "no_answer"}) == Ask.STANDS_FAST
    assert next_step(unsure | {"reliability": "reliable"}) == Ask.CLEARED


@pytest.mark.parametrize("verdict", ["stiction", "inconclusive"])
def test_a_loop_that_is_controlled_no_more_comes_first(verdict):
    row = row_of(verdict, "not_reliable", None)
    assert next_step(row | {"reasons": "pv_stands;uncoupled"}).startswith("Look today")
    assert next_step(row | {"reasons": "answers_no_more;prior_only"}).startswith("Look today")
    assert next_step(row | {"reasons": "wound_up"}) == Ask.AT_LIMIT
    assert {"pv_stands", "wound_up", "answers_no_more"} <= REASON_WORDS.keys()


def test_a_loop_that_is_stated_to_move_no_valve_is_not_asked_for_one():
    row = row_of("stiction", "not_reliable", "stiction")
    assert next_step(row | {"reasons": "moves_no_valve"}) == Ask.NO_VALVE
    assert "valve of its own" not in Ask.NO_VALVE


@pytest.mark.parametrize(
    ("cause", "step"),
    [
        (None, Ask.HAS_BAND),
        ("no_oscillation", Ask.HAS_BAND),
        ("disturbance", Ask.HAS_BAND),
        ("set_point_following", next_steps.BY_CAUSE["set_point_following"]),
        ("backlash", next_steps.BY_CAUSE["backlash"]),
        ("external_oscillation", next_steps.BY_CAUSE["external_oscillation"]),
    ],
)
def test_a_band_is_looked_for_at_the_valve_unless_a_nearer_cause_is_named(cause, step):
    row = row_of("no_stiction", "not_reliable", cause)
    assert next_step(row | {"reasons": "hidden_band"}) == step
    assert "hidden_band" in REASON_WORDS
    sticks = row_of("stiction", "reliable", "stiction")
    assert next_step(sticks | {"reasons": "hidden_band"}) == Ask.STICKS


def test_a_swing_that_no_valve_makes_is_looked_for_elsewhere():
    row = row_of("stiction", "not_reliable", "stiction")
    assert next_step(row | {"reasons": "foreign_cycle"}) == Ask.MAY_BE_SHAKEN
    assert next_step(row | {"reasons": "outside_corners"}) == Ask.MAY_BE_SHAKEN
    assert next_step(row | {"reasons": "foreign_cycle;stiction_began"}) == Ask.BEGAN_TO_STICK
    assert "foreign_cycle" in REASON_WORDS


def test_nobody_is_sent_to_the_tuning_for_a_verdict_that_is_not_relied_on():
    for cause in ("tight_tuning", "aggressive_controller", "sluggish_controller"):
        sure = row_of("no_stiction", "reliable", cause)
        assert next_step(sure) == BY_CAUSE[cause]
        assert next_step(sure | {"reliability": "not_reliable"}) == next_steps.BY_CAUSE_UNSURE[cause]


def test_too_few_swings_ask_for_a_longer_record_and_say_how_long():
    row = row_of("stiction", "not_reliable", "stiction")
    row["oscillation_period_s"] = 2067.0
    assert next_step(row | {"reasons": "few_cycles"}).endswith(
        "A longer record will tell more: 5 cycles of this loop take 2.9 h."
    )
    assert next_step(row | {"oscillation_period_s": 130.0, "reasons": "few_cycles"}).endswith("take 11 min.")
    assert "longer record" not in next_step(row)
    assert "longer record" not in next_step(row | {"reliability": "reliable", "reasons": "few_cycles"})
    assert next_step(row | {"reasons": "before_repair;few_cycles"}) == Ask.WAIT


def test_a_longer_record_is_not_asked_for_where_the_record_has_room_for_the_swings():
    """Of a long record a stretch is judged, of as many hours however long the record is."""
    row = row_of("stiction", "not_reliable", "stiction") | {"reasons": "stiction_began;few_cycles"}
    row |= {"oscillation_period_s": 5426.0, "sampling_interval_s": 20.0}
    assert next_step(row | {"window_samples": 21600}).endswith("ask for a stroke test.")
    assert next_step(row | {"window_samples": 1356}).endswith("5 cycles of this loop take 7.6 h.")
    assert next_step(row | {"window_samples": None}).endswith("5 cycles of this loop take 7.6 h.")


def test_a_repair_counts_from_when_it_is_written_down():
    row = row_of("stiction", "reliable", "stiction")
    row["window_end"] = "2026-01-02T00:00:00.500Z"
    assert next_step(row, "2026-01-02T00:00:01Z") == Ask.WAIT
    assert next_step(row, "2026-01-02T00:00:00Z") == Ask.STICKS


@pytest.mark.parametrize(
    ("told", "objected"),
    [
        ({"reasons": "few_cycles;reference_disagrees"}, True),
        ({"reasons": "yper_high_stiction", "likely_cause": "no_oscillation"}, True),
        ({"hammerstein_rmse": 0.89, "hammerstein_rmse_without_stiction": 1.0}, True),
        ({"hammerstein_rmse": 0.99, "hammerstein_rmse_without_stiction": 1.0}, False),
        ({"reasons": "reference_disagrees", "likely_cause": "disturbance"}, False),
        ({"reasons": "reference_disagrees", "reliability": "reliable"}, False),
    ],
)
def test_nothing_is_no_step_where_the_published_rule_says_stiction(told, objected):
    step = next_step(row_of("no_stiction", "not_reliable", None) | told)
    assert step.startswith(Ask.OBJECTED) is objected


def test_a_longer_record_is_not_waited_for_where_a_look_is_due_today():
    row = row_of("inconclusive", "not_reliable", UNANSWERED) | {"reasons": "pv_stands;few_cycles"}
    assert next_step(row | {"oscillation_period_s": 600.0}) == BY_CAUSE[UNANSWERED]
