"""The best of some points, none of them nearly another."""

import pytest

from app.engine.mismatch.fit.unlike import unlike_better_ones


@pytest.mark.parametrize(("most", "kept"), [(None, [9, 5, 12, 1]), (1, [9]), (3, [9, 5, 12]), (9, [9, 5, 12, 1])])
def test_a_point_near_a_better_one_is_left_out_and_one_near_such_a_point_is_not(most, kept):
    """8 is left out for 9, and 7 too; 6 is near 5, which was kept."""
    assert unlike_better_ones([9, 8, 7, 5, 6, 12, 1], lambda a, b: abs(a - b) <= 2, most) == kept


def test_no_more_points_are_asked_for_than_are_kept():
    asked = iter([3, 2, 1])
    assert unlike_better_ones(asked, lambda a, b: a == b, 2) == [3, 2]
    assert list(asked) == [1]
