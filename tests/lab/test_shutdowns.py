"""Units that are shut down, as simulated: what stood at one time is told of together, and who died alone is not."""

from app.lab.testbench import shutdowns
from app.lab.testbench.shutdowns import KINDS, Kind, Told, held, told


def test_loops_of_one_unit_are_one_group_without_the_one_that_died_hours_before():
    found = told(Kind(held, 5, 20.0), 0)
    assert (found.groups, found.alone_in_group) == (1, False)
    assert 3 <= found.together == found.stand


def test_transmitters_that_die_by_themselves_are_no_group():
    found = told(Kind(held, 4, None), 0)
    assert (found.groups, found.together) == (0, 0)
    assert found.stand >= 3


def test_each_kind_is_told_of_so_many_plants_from_the_first_seed_on(monkeypatch, capsys):
    monkeypatch.setattr(shutdowns, "told", lambda kind, seed: Told(kind.loops, seed, seed - 1, 1, seed == 4))
    assert shutdowns.main(["--plants", "2", "--seed", "3"]) == 0
    rows = [f"| {name} | 7 of {2 * kind.loops} | 5 | 2 in 2 plants | 1 of 2 |" for name, kind in KINDS.items()]
    assert capsys.readouterr().out.splitlines()[2:] == rows
