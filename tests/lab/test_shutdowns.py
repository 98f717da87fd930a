"""Units that are shut down, as simulated: what stood at one time is told of together, and who died alone is not."""

from app.lab.testbench.shutdowns import Kind, held, told


def test_loops_of_one_unit_are_one_group_without_the_one_that_died_hours_before():
    found = told(Kind(held, 5, 20.0), 0)
    assert (found.groups, found.alone_in_group) == (1, False)
    assert 3 <= found.together == found.stand


def test_transmitters_that_die_by_themselves_are_no_group():
    found = told(Kind(held, 4, None), 0)
    assert (found.groups, found.together) == (0, 0)
    assert found.stand >= 3
