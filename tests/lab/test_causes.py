"""The bench of spoiled loops and the table of causes."""

from collections import Counter

import numpy as np
import pytest

from app.lab.evaluation.causes import RIGHT, confusion
from app.lab.testbench.causes import spoiled_loops
from app.lab.testbench.spells import spell


def test_every_cause_is_built_and_again_the_same():
    once, again = list(spoiled_loops(1, seed=5)), list(spoiled_loops(1, seed=5))
    assert set(Counter(x.cause for x in once).items()) == {(cause, 1) for cause in RIGHT}
    for a, b in zip(once, again, strict=True):
        np.testing.assert_array_equal(a.recording.pv, b.recording.pv)


def test_confusion_counts_right_wrong_and_silent():
    stated = [("quiet", "disturbance"), ("quiet", None), ("quiet", "saturated_op"), ("stiction", "stiction")]
    table = confusion(stated, RIGHT)
    assert "| quiet | 3 | 1 | 1 | 1 |" in table
    assert "| stiction | 1 | 1 | 0 | 0 |" in table
    assert table.endswith("stated 2 times and right 1 times, 50 %.")


def test_a_spell_has_the_length_that_it_says():
    made = spell(1, samples=4000, share=0.25, first=0.5)
    interval = made.recording.time_s[1]
    assert (made.end_s - made.start_s) / interval == pytest.approx(1000)
    assert made.recording.samples == 4000
