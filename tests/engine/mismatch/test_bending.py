"""What a given simulation holds beside a linear model changes with the parameters that the record shows."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, explain
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.compare.resting import rest_along
from app.engine.mismatch.fit.bending import as_refitted
from app.engine.mismatch.free_runs import free_runs
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.recording import FloatArray
from tests.engine.plain_loop import TS, moves, noise

TAU, LATE = 30.0, 4.0


def bent(u: FloatArray, gain: float = 1.0, slower: float = 1.0) -> FloatArray:
    """Behind a lag a reading that levels out."""
    x = run_process(u, Plant(K=1.0, tau=TAU * slower, theta=LATE), TS)
    return 50.0 + gain * (4.0 * np.tanh(x / 4.0) + 0.15 * x)


def loop(seed: int, gain: float, slower: float) -> Comparison:
    """A simulation that bends as the loop does, its gain and its time constant off."""
    u = moves(seed=seed)
    return Comparison("bent", TS, 40.0 + u, bent(u) + 0.2 * noise(seed), trace=bent(u, gain, slower))


def test_a_right_simulation_that_bends_may_be_off_as_a_linear_one_may() -> None:
    said = explain(loop(3, gain=1.06, slower=0.94))
    assert said.effects == ()


@pytest.mark.parametrize("later", [0.0, TS, -TS])
def test_what_lies_beside_the_linear_model_has_gain_time_constant_and_dead_time_found(later: float) -> None:
    u = moves(seed=5)
    u = u - u[0]
    given, found = Plant(K=1.0, tau=TAU, theta=LATE), Plant(K=1.1, tau=1.2 * TAU, theta=LATE + later)
    passed = as_refitted(run_process(u, given, TS), given, found, TS)
    assert passed[:-1] == pytest.approx(run_process(u, found, TS)[:-1], abs=1e-9)


def test_along_a_second_recording_it_is_changed_alike() -> None:
    first = loop(3, 1.07, 1.0)
    prepared = prepare(first)
    assert prepared.bent is not None
    again = rest_along(prepared, prepared.record, first.trace)
    assert again[100:] == pytest.approx(prepared.record.rest[100:], abs=1e-3 * np.std(prepared.record.rest))


def test_what_is_held_out_does_not_change_what_lies_beside_the_model() -> None:
    """Where the loop has another gain there, the free run that has not seen it has none of that."""
    first, rests = loop(3, 1.07, 1.0), []
    later = np.arange(len(first.pv)) >= 0.7 * len(first.pv)
    for gain in (1.0, 0.95):
        pv = np.where(later, 50.0 + gain * (first.pv - 50.0), first.pv)
        prepared = prepare(replace(first, pv=pv))
        assert prepared.bent is not None
        rests.append(free_runs(prepared, prepared.base, later).model.record.rest)
    assert rests[0] == pytest.approx(rests[1], abs=3e-3 * np.std(rests[1]))
