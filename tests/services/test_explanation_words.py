"""What an explanation says at its head."""

import pytest

from app.services.explaining.wording import VERDICT_WORDS, verdict_in_words

NAMED, UNSURE = VERDICT_WORDS["missing_physics"], "which, the record hardly tells"


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
    assert verdict_in_words(verdict, [{"probability": p} for p in probabilities]) == told
