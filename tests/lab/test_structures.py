"""The simulated wirings: each is what its name says, and the table counts what was said."""

from collections import Counter, defaultdict

import numpy as np
import pytest

from app.lab.testbench import structures
from app.lab.testbench.structures import KINDS, WITH_A_VALVE, record
from app.lab.testbench.wiring import Lag, Pi, Valve


def _moves(signal):
    return float(np.mean(np.diff(signal) != 0))


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_kind_gives_a_record_that_moves_and_is_the_same_again(kind):
    found, again = record(kind, 3, sticks=False), record(kind, 3, sticks=False)
    assert found.fingerprint() == again.fingerprint()
    assert np.ptp(found.pv) > 0.2
    assert np.ptp(found.op) > 0.2
    assert found.op.min() >= 0.0
    assert found.op.max() <= 100.0


@pytest.mark.parametrize("kind", WITH_A_VALVE, ids=lambda kind: kind.__name__)
def test_a_valve_that_sticks_makes_another_record(kind):
    assert not np.array_equal(record(kind, 3, sticks=True).pv, record(kind, 3, sticks=False).pv)


def test_the_set_point_moves_where_the_wiring_says_so():
    moving = {structures.ratio, structures.set_points_from_above, structures.batch_profile, structures.cascade_inner}
    for kind in KINDS:
        assert (_moves(record(kind, 5, sticks=False).sp) > 0.0) == (kind in moving), kind.__name__


def test_a_thermostat_has_two_values_and_is_not_audited():
    assert set(record(structures.on_off, 2, sticks=False).op) == {20.0, 80.0}
    assert structures.said_of(structures.on_off, 2, sticks=False) == "not_auditable"


def test_a_stem_that_sticks_moves_only_beyond_its_band():
    stem = Valve(50.0, S=4.0, J=2.0)
    assert stem.to(51.0) == 50.0
    assert stem.to(57.0) > 50.0
    assert Valve(50.0).to(51.0) == 51.0


def test_a_lag_ends_at_its_gain_after_its_dead_time():
    lag = Lag(2.0, 10.0, delay=3)
    went = [lag.after(1.0, 5.0) for _ in range(60)]
    assert went[:3] == [0.0] * 3
    assert went[3] > 0.0
    assert went[-1] == pytest.approx(2.0, abs=1e-6)


def test_an_integral_held_by_a_limit_leaves_it_at_once():
    pi = Pi(1.0, 10.0, 50.0)
    for _ in range(100):
        assert pi.output(80.0, 5.0) <= 100.0
    assert pi.output(-1.0, 5.0) < 100.0


def test_the_controller_that_does_not_move_the_valve_follows_it():
    pi = Pi(2.0, 10.0, 50.0)
    pi.follow(30.0, 4.0)
    assert pi.output(4.0, 0.0) == pytest.approx(30.0)


def test_the_table_counts_what_was_said(capsys):
    said = defaultdict(Counter, {
        ("plain", False): Counter({"stiction!": 1, "stiction": 2, "no_stiction!": 4, "inconclusive": 3}),
        ("plain", True): Counter({"stiction!": 5, "not_auditable": 1}),
        ("time_proportioned", False): Counter({"stiction": 1}),
        ("cascade_outer, beside the other", True): Counter({"no_stiction": 2}),
    })  # fmt: skip
    lines = list(structures.report(said))
    assert "| plain (10, 6) | 3 | 1 | 4 | 5 | 5 | 0 | 1 |" in lines
    assert "| all (11, 6) | 4 | 1 | 4 | 5 | 5 | 0 | 1 |" in lines
    assert lines[-1] == "| cascade outer, beside the other (0, 2) | 0 | 0 | 0 | 0 | 0 | 0 | 0 |"
    assert structures.main(["--loops", "1", "--seed", "7"]) == 0
    assert capsys.readouterr().out.count("\n") == len(KINDS) + 5


def test_the_outer_loop_is_cleared_by_itself_and_not_beside_its_inner_one():
    assert structures.said_of(structures.cascade_outer, 1000, sticks=True) == "no_stiction!"
    assert structures.said_beside(1000, sticks=True) == {
        "cascade_inner, beside the other": "stiction!",
        "cascade_outer, beside the other": "no_stiction",
    }
