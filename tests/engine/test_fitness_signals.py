"""What is measured of signals before a record is judged: literal numbers."""

import numpy as np
import pytest

from app.engine.fitness.signals import (
    newest_long_run,
    on_line_share,
    quantisation_step,
    run_lengths,
    set_point_activity,
)


def test_newest_long_run():
    assert newest_long_run(np.array([True, False, True, True, False]), 0.5, 1) == slice(2, 4)
    assert newest_long_run(np.array([True, True, True, False, True, False]), 0.5, 1) == slice(0, 3)
    assert newest_long_run(np.array([True, True, True, False, True, True]), 0.5, 3) == slice(0, 3)
    assert newest_long_run(np.array([True, True, True, False, True, True]), 0.5, 4) == slice(0, 3)  # none has as many
    assert newest_long_run(np.zeros(3, dtype=bool), 0.5, 1) == slice(0, 0)
    assert newest_long_run(np.zeros(0, dtype=bool), 0.5, 1) == slice(0, 0)


def test_run_lengths():
    assert run_lengths(np.array([1.0, 1.0, 2.0, 3.0, 3.0, 3.0])).tolist() == [2, 2, 1, 3, 3, 3]


def test_quantisation_step():
    assert quantisation_step(np.array([0.5, 1.0, 2.5, 1.0])) == 0.5
    assert quantisation_step(np.ones(4)) is None


def test_on_line_share():
    assert on_line_share(np.array([0.0, 1.0, 2.0, 3.0, 3.0, 3.0])) == 0.5
    assert on_line_share(np.array([0.0, 1.0])) == 0.0


@pytest.mark.parametrize(
    ("sp", "pv", "activity"),
    [
        ([1.0, 3.0, 1.0, 3.0], [10.0, 14.0, 10.0, 14.0], 0.5),
        ([2.0, 2.0, 2.0, 2.0], [10.0, 14.0, 10.0, 14.0], 0.0),
        ([1.0, 3.0, 1.0, 3.0], [10.0, 10.0, 10.0, 10.0], None),
        (None, [10.0, 14.0, 10.0, 14.0], None),
        ([], [], None),
    ],
)
def test_set_point_activity_is_its_spread_over_that_of_pv(sp, pv, activity):
    assert set_point_activity(None if sp is None else np.array(sp), np.array(pv)) == activity
