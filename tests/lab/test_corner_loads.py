"""The bench of loads in corners from elsewhere."""

from types import SimpleNamespace

import numpy as np
import pytest

from app.lab.testbench import corner_loads, seeded
from app.lab.testbench.corner_loads import HEALTHY, LOADS, STICKING, Course, record, report


@pytest.mark.parametrize(
    ("kind", "sticks"), [*((kind, False) for kind in HEALTHY), *((kind, True) for kind in STICKING)]
)  # fmt: skip
def test_a_loop_is_the_same_for_a_seed_and_moves(kind, sticks):
    first, again, other = record(kind, 5, sticks), record(kind, 5, sticks), record(kind, 6, sticks)
    np.testing.assert_array_equal(first.pv, again.pv)
    assert 700 <= len(first.pv) < 3000
    assert np.isfinite(first.pv).all()
    assert np.ptp(first.op) > 0.1
    assert not np.array_equal(first.op[:700], other.op[:700])


@pytest.mark.parametrize("name", LOADS)
def test_a_load_comes_and_goes_about_once_a_cycle(name):
    load = LOADS[name](Course(np.random.default_rng(3), 500.0, 4.0, 4000))
    assert load.shape == (4000,)
    assert 0.5 < np.std(load) < 16.0
    crossings = np.count_nonzero(np.diff(load > np.mean(load)))
    assert 20 < crossings < 160  # 40 cycles of 100 scans


def test_verdicts_are_counted_by_kind(monkeypatch):
    said = {
        sticks: SimpleNamespace(verdict="stiction", reliability=reliability)
        for sticks, reliability in ((False, "not_reliable"), (True, "reliable"))
    }
    monkeypatch.setattr(corner_loads, "record", lambda kind, seed, sticks: said[sticks])
    monkeypatch.setattr(seeded, "audit", lambda judgement: SimpleNamespace(judgement=judgement))
    head, rule, *lines = report(range(1, 5))
    assert head.count("|") == rule.count("|") == lines[0].count("|")
    assert lines[: len(HEALTHY)] == [f"| healthy | {kind} | 4 | 4 | 0 | 0 |" for kind in HEALTHY]
    assert lines[len(HEALTHY) :] == [f"| sticks | {kind} | 4 | 4 | 4 | 0 |" for kind in STICKING]


def test_it_runs_from_the_command_line(capsys):
    assert corner_loads.main(["--loops", "1", "--seed", "3"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2 + len(HEALTHY) + len(STICKING)
