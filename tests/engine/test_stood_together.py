"""Loops that came to stand at the same time, and chance, which brings some together too."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from app.engine.plant_wide.stood_together import CHANCE, FEWEST, SHUT_DOWN_S, Stand, stood_together

DAY, MINUTE, TS = 86_400.0, 60.0, 10.0
START = 1_750_000_000.0


def stands(at_s, unit=None, name="L", reach_s=DAY):
    return [Stand(f"{name}{k}", START + at, reach_s, TS, unit) for k, at in enumerate(at_s)]


def shut_down(at_s=8 * 3600.0, minutes=20.0, loops=8, unit="U1"):
    return stands(at_s + MINUTE * np.linspace(0.0, minutes, loops), unit, "down ")


ONE = stands([3 * 3600.0], "U2", "alone ")


def test_a_unit_that_is_shut_down_is_one_and_a_transmitter_that_died_before_is_another():
    (found,) = stood_together([*shut_down(), *ONE])
    assert [stand.tag for stand in found.stands] == [f"down {k}" for k in range(8)]
    assert (found.since_s, found.span_s, found.unit) == (START + 8 * 3600.0, 20 * MINUTE, "U1")
    assert not found.at_once
    assert 0.0 < found.chance_probability < 1e-9


def test_what_one_card_reads_stands_in_one_scan():
    card = stands([7200.0, 7200.0, 7210.0, 7200.0], None, "card ")
    (found,) = stood_together([*card, *ONE])
    assert (found.in_one_scan, found.at_once, found.unit) == (4, True, None)
    # One whose PV moves in coarse steps had held its value for some minutes already.
    (found,) = stood_together([*card, replace(card[0], tag="coarse", since_s=START + 6800.0)])
    assert (len(found.stands), found.in_one_scan, found.at_once) == (5, 4, True)


def test_two_loops_are_no_group_and_three_within_an_hour_and_a_half_neither():
    assert FEWEST == 3
    assert stood_together([]) == ()
    assert stood_together(stands([0.0, 0.0])) == ()
    assert stood_together(stands([0.0, 2700.0, 5400.0])) == ()
    assert len(stood_together(stands([0.0, 900.0, 1700.0]))) == 1


def test_two_shutdowns_of_a_day_are_two_groups_in_the_order_of_time():
    late, early = shut_down(20 * 3600.0), [replace(one, tag=f"early {one.tag}") for one in shut_down(4 * 3600.0)]
    found = stood_together([*late, *ONE, *early])
    assert [group.since_s for group in found] == [START + 4 * 3600.0, START + 20 * 3600.0]
    assert {len(group.stands) for group in found} == {8}


def test_a_shutdown_that_takes_longer_goes_on_as_long_as_the_next_loop_follows_soon():
    slow = stands(8 * 3600.0 + MINUTE * np.arange(0.0, 50.0, 7.0), "U1", "down ")
    (found,) = stood_together([*slow, *ONE])
    assert len(found.stands) == len(slow)
    (found,) = stood_together([*slow, *stands([8 * 3600.0 + 61 * MINUTE], "U1", "too late ")])
    assert len(found.stands) == len(slow)


def test_who_died_in_another_record_says_nothing_of_today():
    """Two hundred transmitters that died in the course of a year, each of which is known since when."""
    rng = np.random.default_rng(0)
    dead = stands(-DAY - np.sort(rng.uniform(0.0, 365 * DAY, 200)), None, "dead ")
    found = stood_together([*shut_down(), *dead])
    assert [len(group.stands) for group in found if group.since_s >= START] == [8]


@pytest.mark.parametrize("reach_s", [900.0, 1200.0, 3600.0])
def test_records_shorter_than_a_shutdown_show_no_three_together(reach_s):
    """Within half an hour is all the time that they have."""
    assert stood_together(stands([0.0, 1000.0, 1700.0], reach_s=reach_s)) == ()


def test_neither_order_nor_the_clock_changes_anything():
    given = [*shut_down(), *ONE]
    later = [replace(one, since_s=one.since_s + 1e6) for one in reversed(given)]
    (found,), (again,) = stood_together(given), stood_together(later)
    assert [stand.tag for stand in found.stands] == [stand.tag for stand in again.stands]
    assert found.chance_probability == pytest.approx(again.chance_probability)


@pytest.mark.parametrize("loops", [3, 6, 10, 30])
def test_transmitters_that_die_at_random_times_are_rarely_told_of_together(loops):
    rng = np.random.default_rng(loops)
    draws = 1000
    wrong = sum(bool(stood_together(stands(rng.uniform(0.0, DAY, loops)))) for _ in range(draws))
    assert wrong <= binom.ppf(0.999, draws, CHANCE)


def test_the_chance_that_is_told_is_how_often_it_comes_and_twice_that_for_two_widths():
    """Four of ten within half an hour of two days, counted."""
    rng = np.random.default_rng(1)
    drawn = np.sort(rng.uniform(0.0, 2 * DAY, (200_000, 10)), axis=1)
    often = float(np.mean(np.min(drawn[:, 3:] - drawn[:, :-3], axis=1) <= SHUT_DOWN_S))
    others = 6 * 3600.0 * np.arange(1, 7)
    (found,) = stood_together(stands([0.0, 60.0, 1200.0, 1700.0, *others], reach_s=2 * DAY))
    assert found.chance_probability == pytest.approx(2.0 * often, rel=0.25)
