"""Statistics of values that hold for unequal times, against the same values repeated."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.engine.fitness import FitnessConfig
from app.engine.timed import Timed, holding_times

WANTED = (0.0, 5.0, 31.0, 50.0, 95.0, 100.0)


@given(st.lists(st.tuples(st.floats(-1e3, 1e3), st.integers(1, 9)), min_size=1, max_size=30), st.floats(0.01, 100.0))
def test_what_holds_longer_counts_as_if_it_came_again(pairs, unit_s):
    values, times = np.array([value for value, _ in pairs]), np.array([time for _, time in pairs])
    times = np.append(times, 1)  # the shortest is the unit
    values = np.append(values, 0.5)
    held, again = Timed(values, unit_s * times), Timed(np.repeat(values, times), None)
    assert held.mean() == pytest.approx(again.mean(), abs=1e-9)
    assert held.std() == pytest.approx(again.std(), abs=1e-6)
    assert held.percentiles(WANTED) == pytest.approx(again.percentiles(WANTED), abs=1e-6)
    assert held.share(values > 0.0) == pytest.approx(again.share(again.values > 0.0))


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=50))
def test_equal_times_change_nothing(values):
    values = np.array(values)
    held, plain = Timed(values, np.full(len(values), 3.7)), Timed(values, None)
    assert held.mean() == pytest.approx(plain.mean(), abs=1e-9)
    assert held.percentiles(WANTED) == pytest.approx(plain.percentiles(WANTED), abs=1e-9)


def test_of_nothing_there_is_nothing():
    nothing = Timed(np.empty(0), None)
    assert (nothing.mean(), nothing.std(), nothing.percentiles((50.0,))) == (None, None, [None])


def test_stamps_that_are_a_little_late_hold_equally_long():
    assert holding_times(np.arange(100.0) + 0.1 * np.tile([0.0, 1.0], 50)) is None
    assert holding_times(np.array([0.0, 5.0])) is None


def test_a_value_holds_until_the_next_one_came():
    assert holding_times(np.array([0.0, 1.0, 2.0, 6.0, 7.0])).tolist() == [1.0, 1.0, 4.0, 1.0, 1.0]


def test_over_a_hole_a_value_does_not_hold_and_two_holes_are_no_slower_sampling():
    time_s = np.concatenate((np.arange(10.0), [500.0], 1000.0 + np.arange(10.0)))
    held_s = holding_times(time_s)
    assert held_s[9:11].tolist() == [10.0, 10.0]
    assert held_s.sum() == pytest.approx(39.0)


@pytest.mark.parametrize("last", [False, True])
def test_a_hole_beside_an_end_is_a_hole(last):
    time_s = np.append(np.arange(10.0), 500.0)
    time_s = time_s if last else 500.0 - time_s[::-1]
    assert holding_times(time_s).max() == 10.0


def test_a_slower_sampling_is_no_hole():
    held_s = holding_times(np.concatenate((600.0 * np.arange(6), 3600.0 + np.arange(100.0))))
    assert held_s.tolist() == [600.0] * 6 + [1.0] * 100


def test_how_long_a_value_holds_and_what_is_late_can_be_configured():
    slow = np.array([0.0, 1.0, 2.0, 6.0, 7.0])
    assert holding_times(slow, FitnessConfig(max_gap_intervals=2.0)).tolist() == [1.0, 1.0, 2.0, 1.0, 1.0]
    assert holding_times(slow, FitnessConfig(jitter_tolerance=3.0)) is None
