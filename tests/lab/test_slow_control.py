"""The bench of sluggish loops under a load that wanders."""

from types import SimpleNamespace

import numpy as np
import pytest

from app.lab.testbench import seeded, slow_control
from app.lab.testbench.slow_control import KINDS, record, report


@pytest.mark.parametrize("kind", KINDS)
def test_a_loop_is_the_same_for_a_seed_and_its_valve_sticks_where_it_should(kind):
    first, again, sticking = record(kind, 5, False), record(kind, 5, False), record(kind, 5, True)
    np.testing.assert_array_equal(first.pv, again.pv)
    for one in (first, sticking):
        assert 600 <= len(one.pv) < 1900
        assert np.isfinite(one.pv).all()
        assert np.ptp(one.op) > 0.1
    assert not np.array_equal(first.op[:600], sticking.op[:600])


def test_verdicts_are_counted_by_kind(monkeypatch):
    said = {
        sticks: SimpleNamespace(verdict=verdict, reliability=reliability)
        for sticks, verdict, reliability in ((False, "no_stiction", "reliable"), (True, "stiction", "not_reliable"))
    }
    monkeypatch.setattr(slow_control, "record", lambda kind, seed, sticks: said[sticks])
    monkeypatch.setattr(seeded, "audit", lambda judgement: SimpleNamespace(judgement=judgement))
    head, rule, *lines = report(range(1, 5))
    assert head.count("|") == rule.count("|") == lines[0].count("|")
    assert lines == [f"| {kind} (4, 4) | 0 | 0 | 4 | 4 | 0 | 0 |" for kind in KINDS]


def test_it_runs_from_the_command_line(capsys):
    assert slow_control.main(["--loops", "1", "--seed", "3"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2 + len(KINDS)
