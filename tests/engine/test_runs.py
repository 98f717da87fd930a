"""Where a mask is True without a break, and the best points that are no neighbours."""

import numpy as np
import pytest

from app.engine.mismatch.fit.unlike import unlike_better_ones
from app.engine.signals.runs import runs_of


@pytest.mark.parametrize(
    ("mask", "starts", "ends"),
    [
        ([], [], []),
        ([0, 0], [], []),
        ([1, 1, 1], [0], [3]),
        ([1, 0, 0, 1, 1, 0], [0, 3], [1, 5]),
        ([0, 1, 0, 1], [1, 3], [2, 4]),
    ],
)
def test_a_run_is_from_its_first_sample_to_the_one_behind_its_last(mask, starts, ends):
    found = runs_of(np.array(mask, dtype=np.bool_))
    assert [at.tolist() for at in found] == [starts, ends]


@pytest.mark.parametrize(("most", "kept"), [(None, [9, 5, 12, 1]), (1, [9]), (3, [9, 5, 12]), (9, [9, 5, 12, 1])])
def test_a_point_near_a_better_one_is_left_out_and_one_near_such_a_point_is_not(most, kept):
    """8 is left out for 9, and 7 too; 6 is near 5, which was kept."""
    assert unlike_better_ones([9, 8, 7, 5, 6, 12, 1], lambda a, b: abs(a - b) <= 2, most) == kept


def test_no_more_points_are_asked_for_than_are_kept():
    asked = iter([3, 2, 1])
    assert unlike_better_ones(asked, lambda a, b: a == b, 2) == [3, 2]
    assert list(asked) == [1]
