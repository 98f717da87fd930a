"""The measurement of the size of stiction: loops that know their S, and a table that counts what was said of them."""

from dataclasses import replace

import numpy as np
import pytest

from app.lab.testbench.case import ordinary
from app.lab.testbench.sizing import Sized, fitted, known, sized, table, verify


def test_loops_know_their_S_and_are_sized():
    loops = [*verify(3, 5), *fitted(2, 5)]
    assert len(loops) == 5
    assert all(loop.S > 0.0 for loop in loops)
    assert any(answer is not None for answer in map(sized, loops))


def test_the_same_seed_gives_the_same_loops():
    one, other = next(verify(1, 3)), next(verify(1, 3))
    assert (one.S, one.valve, one.record.op.tolist()) == (other.S, other.valve, other.record.op.tolist())


def test_the_table_counts_errors_and_coverage_by_valve():
    said = [
        Sized("he", True, 0.1, (False, True, True)),
        Sized("he", True, -0.3, (True, True, True)),
        Sized("kano", True, 0.0, (True, True, True)),
        Sized("kano", False, 2.0, (False, False, False)),
    ]
    rows = table(said, 10).splitlines()
    assert rows[0].startswith("| of 10 loops")
    assert rows[2] == "| identifiable | 3 | 10.0 ± 8.7 % | 0.0 ± 11.5 % | 26.0 % | 67 ± 27 % | 100 ± 0 % | 100 ± 0 % |"
    assert [row.split(" | ")[0] for row in rows[3:]] == ["| he", "| kano", "| not identifiable"]


@pytest.fixture(scope="module")
def told():
    """What is identifiable of a draw on which no number was chosen."""
    return [answer for answer in map(sized, verify(1500, 31)) if answer is not None and answer.identifiable]


def test_S_is_read_within_a_tenth_and_neither_low_nor_high(told):
    error = np.array([answer.error for answer in told])
    assert len(told) > 250
    assert np.median(np.abs(error)) < 0.10
    assert abs(np.median(error)) < 0.04


@pytest.mark.parametrize(("place", "stated"), [(0, 0.5), (1, 0.8), (2, 0.95)])
def test_intervals_hold_the_truth_as_often_as_they_say(told, place, stated):
    held = np.mean([answer.covered[place] for answer in told])
    assert abs(held - stated) < 2.5 * np.sqrt(stated * (1.0 - stated) / len(told))


def test_noise_between_the_samples_does_not_make_S_small():
    """The valve hears the noise of every scan, the record shows one scan in some."""
    rng = np.random.default_rng(32)
    noisy = [replace(ordinary(rng, "stiction"), noise_share=0.2, valve="physical") for _ in range(150)]
    said = [answer for answer in map(sized, filter(None, map(known, noisy))) if answer is not None]
    error = np.array([answer.error for answer in said if answer.identifiable])
    assert len(error) > 25
    assert abs(np.median(error)) < 0.08
