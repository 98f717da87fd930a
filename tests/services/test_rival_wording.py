"""Why the first explanation is first where another one has the higher score."""

from types import SimpleNamespace
from typing import Any

import pytest

from app.engine.rivals import Rival, contest, winner
from app.services.telling.rival_wording import why_first

SEEN = SimpleNamespace(named=lambda name: 0.5)  # what a fit in free run explains, for the text of stiction alone


def told(probability: float, *rivals: Rival) -> str | None:
    """As the engine ranks them and as a verdict's detail keeps them."""
    ranked = contest(rivals, probability, SEEN)
    first = winner(ranked)
    kept: list[dict[str, Any]] = [{"code": r.cause, "score": r.strength, "applies": r.applies} for r in ranked]
    return why_first(kept, first.cause if first else None)


def test_stiction_above_one_half_wins_against_a_higher_score_and_it_is_said_why():
    said = told(0.6, Rival("saturated_op", 1.0, "seen"), Rival("tight_tuning", 0.3, "seen"))
    assert said is not None
    assert said.startswith("“the valve sticks” wins although “OP at its limit” scored higher: its score is what")


def test_the_nearer_of_two_that_stand_out_wins_and_it_is_said_why():
    said = told(0.1, Rival("saturated_op", 0.7, "seen"), Rival("external_oscillation", 0.9, "seen"))
    assert said is not None
    assert said.startswith(
        "“OP at its limit” wins although “external oscillation” scored higher: all of them stand out"
    )


def test_all_that_scored_higher_are_named():
    three = (Rival("saturated_op", 0.9, "a"), Rival("tight_tuning", 0.8, "b"), Rival("no_oscillation", 0.7, "c"))
    assert "although “OP at its limit”, “tight tuning” and “does not oscillate” scored" in str(told(0.6, *three))


@pytest.mark.parametrize(
    ("probability", "strengths"),
    [(0.9, (0.8, 0.2)), (0.3, (0.9, 0.8)), (0.2, (0.4, 0.3))],
    ids=["stiction has the highest score", "a rival has the highest score", "nothing stands out"],
)
def test_nothing_is_said_where_the_scores_explain_it(probability, strengths):
    assert told(probability, *(Rival(f"cause_{n}", strength, "seen") for n, strength in enumerate(strengths))) is None


def test_what_was_not_evaluated_scored_nothing():
    kept = [
        {"code": "stiction", "score": 0.6, "applies": True},
        {"code": "backlash", "score": 0.9, "applies": False},
    ]
    assert why_first(kept, "stiction") is None
    assert why_first([], None) is None
