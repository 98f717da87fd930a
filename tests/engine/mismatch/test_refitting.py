"""The simulation's own parameters are asked for only where they are further off than they are trusted."""

from types import SimpleNamespace

import pytest

from app.engine.mismatch import Comparison, LinearSimulation, explain
from app.engine.mismatch.fit.refitting import OFF_BY, further_off
from app.engine.mismatch.loop.plant import run_process
from tests.engine.plain_loop import TRUE, TS, moves, noise


def told(gain=1.0, time=1.0, late=1.0, theta=10.0, interval_s=1.0) -> bool:
    context = SimpleNamespace(
        plant=SimpleNamespace(theta=theta), record=SimpleNamespace(sampling_interval_s=interval_s)
    )
    return further_off((gain, time, late), context)


@pytest.mark.parametrize("name", ["gain", "time"])
def test_a_factor_is_further_off_from_fifteen_per_cent_on_to_either_side(name):
    assert not told(**{name: 1.0})
    assert not told(**{name: 1.149})
    assert told(**{name: OFF_BY})
    assert not told(**{name: 0.8697})
    assert told(**{name: 1.0 / OFF_BY})


def test_one_factor_that_is_off_is_enough():
    assert told(gain=2.0, time=1.0)
    assert told(gain=1.0, time=0.5)


def test_a_dead_time_is_shorter_by_more_than_fifteen_per_cent_of_it():
    assert not told(late=0.86)
    assert told(late=0.84)


def test_a_dead_time_is_shorter_by_more_than_a_sample():
    assert not told(late=0.71, interval_s=3.0)
    assert told(late=0.69, interval_s=3.0)
    assert not told(late=0.0, theta=1.0, interval_s=1.0)


def test_a_longer_dead_time_is_named_beside_a_gain_that_is_off():
    """What was found of the gain says nothing of the dead time, which stays trusted as it was given."""
    pv = 50.0 + run_process(moves(), TRUE.changed(theta=12.0), TS) + noise()
    given = LinearSimulation(gain=4.0, time_constants_s=(30.0,), dead_time_s=7.0)
    said = explain(Comparison("loop", TS, 40.0 + moves(), pv, simulation=given))
    assert "parameters_off" in {reason.code for reason in said.evidence}
    assert "process.dead_time" in (said.effects[0].code, *said.effects[0].alternatives)
    told = {estimate.name: estimate.value for estimate in said.refit}
    assert told["K"] == pytest.approx(TRUE.K, rel=0.1)
