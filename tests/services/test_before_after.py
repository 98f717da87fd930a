"""What is told of both sides of a repair."""

import pytest

from app.services.moments import UTC_CLOCK
from app.services.plant.before_after import _told


@pytest.mark.parametrize(("reasons", "told"), [("pv_does_not_answer;prior_only", "–"), ("pv_does_not_answer", "0.60")])
def test_a_prior_is_no_probability_that_was_measured(reasons: str, told: str) -> None:
    unknown = ("window_start", "window_end", "health", "stiction_S", "oscillation_period_s", "oscillation_strength")
    said = {"verdict": "inconclusive", "reliability": "not_reliable", "stiction_probability": 0.6, "reasons": reasons}
    assert _told(dict.fromkeys(unknown) | said, UTC_CLOCK, "%")["Probability of stiction"] == told
