"""What an explanation says at its head."""

import pytest

from app.services.explaining.wording import VERDICT_WORDS, named, outcome, verdict_in_words, windows_in_words
from app.services.moments import PlantClock

NAMED, UNSURE = VERDICT_WORDS["missing_physics"], "which one, the record can hardly tell"


@pytest.mark.parametrize(
    ("verdict", "probabilities", "told"),
    [
        ("missing_physics", (0.7,), NAMED),
        ("missing_physics", (0.3, 0.6), NAMED),
        ("missing_physics", (0.22,), f"{NAMED}; {UNSURE}"),
        ("consistent", (), VERDICT_WORDS["consistent"]),
        ("inconclusive", (0.2,), VERDICT_WORDS["inconclusive"]),
        (None, (), ""),
    ],
)
def test_a_name_that_is_not_likely_is_not_announced_as_found(verdict, probabilities, told):
    assert verdict_in_words(verdict, [{"probability": p} for p in probabilities], []) == told


@pytest.mark.parametrize(("verdict", "told"), [("consistent", True), ("inconclusive", False)])
def test_of_a_simulation_that_lacks_nothing_it_is_said_that_its_parameters_are_off(verdict: str, told: bool) -> None:
    words = verdict_in_words(verdict, [], [{"code": "own_dynamics"}, {"code": "parameters_off"}])
    assert words.endswith(", but the simulation's own parameters are off") is told


@pytest.mark.parametrize(
    ("start", "told"),
    [
        ("2026-01-31T21:30:00Z", "2026-01-31 22:30:05 to 22:40:00, 2026-01-31 23:30:00 to 2026-02-01 00:30:00"),
        ("1970-01-01T00:00:00Z", "5–600 s, 3600–7200 s"),
        (None, "5–600 s, 3600–7200 s"),
    ],
)
def test_windows_are_told_by_the_clock_of_the_chart_beside_them(start, told):
    assert windows_in_words([[5.0, 600.0], [3600.0, 7200.0]], start, PlantClock("Europe/Berlin")) == told


def test_a_test_kept_without_figures_is_told_as_not_asked():
    assert outcome({"statistic": None, "limit": 31.4, "p": None, "lags": 20}) == outcome(None) == "–"
    assert outcome({"statistic": 12.0, "limit": 31.4, "p": 0.9, "lags": 20}) == "none seen (p 0.9)"


def test_a_name_for_lack_of_a_better_one_is_no_alarm():
    assert [named([{"probability": p}]) for p in (0.28, 0.5)] == [False, True]
