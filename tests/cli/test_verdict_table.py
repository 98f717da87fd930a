"""The table of verdicts on a terminal."""

import pytest

from app.cli.tables import named, verdict_cells


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
    line = said | {"recording": "A", "loop": "A", "stiction_size": {"S": None}, "yper_pct": None}
    assert str(verdict_cells(line)[1]) == told


@pytest.mark.parametrize(
    ("recording", "loop", "told"),
    [
        ("night", "PIC-202", "night:PIC-202"),
        ("FIC101", "FIC101", "FIC101"),
        ("fic101_may", "FIC101", "fic101_may"),
    ],
)
def test_a_loop_is_named_where_its_recording_does_not_tell(recording: str, loop: str, told: str) -> None:
    assert named({"recording": recording, "loop": loop}) == told
