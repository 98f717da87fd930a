"""The table of verdicts on a terminal."""

import pytest

from app.cli.tables import verdict_cells


@pytest.mark.parametrize(
    ("verdict", "reliability", "probability", "told"),
    [
        ("no_stiction", "not_reliable", 0.42, "no stiction, possibly"),
        ("stiction", "not_reliable", 0.55, "valve sticks, possibly"),
        ("stiction", "reliable", 0.55, "valve sticks"),
        ("no_stiction", "not_reliable", 0.1, "no stiction"),
    ],
)
def test_a_verdict_is_told_as_on_the_pages(verdict: str, reliability: str, probability: float, told: str) -> None:
    said = {"verdict": verdict, "reliability": reliability, "stiction_probability": probability, "reasons": []}
    line = said | {"recording": "A", "stiction_size": {"S": None}, "yper_pct": None}
    assert str(verdict_cells(line)[1]) == told
