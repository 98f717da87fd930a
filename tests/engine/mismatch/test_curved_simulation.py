"""A given simulation that is not linear keeps what it holds beside a linear model, on the second recording too."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, explain
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.compare.resting import rest_along
from app.engine.mismatch.judge.result import Explanation, Improvement
from app.engine.recording import FloatArray
from tests.engine.plain_loop import TS, N, moves, noise, recorded


def curved(u: FloatArray, curve: float) -> FloatArray:
    return u + curve * u * np.abs(u)


def loop(name: str, seed: int, curve: float = 0.05) -> Comparison:
    """A simulation with a curved valve, right but for the noise of PV."""
    u = moves(seed=seed)
    trace = recorded(curved(u, curve)) - noise()
    return Comparison(name, TS, 40.0 + u, trace + noise(seed + 1), trace=trace)


def judged(said: Explanation) -> Improvement:
    assert said.validation is not None
    return said.validation


def codes(said: Explanation) -> list[str]:
    return [reason.code for reason in said.evidence]


def test_a_right_simulation_that_is_curved_is_right_on_the_second_recording() -> None:
    said = explain(loop("first", 3), loop("second", 8))
    told = judged(said)
    assert told.given is not None
    assert said.effects == ()
    assert told.refitted.rmse == pytest.approx(told.given.rmse, rel=0.2)
    assert told.explained.rmse == pytest.approx(told.given.rmse, rel=0.2)
    assert "second_not_simulated" not in codes(said)


@pytest.mark.parametrize("early", [0, 12])
def test_what_the_first_trace_holds_beside_its_linear_model_is_found_along_it_again(early: int) -> None:
    first = loop("first", 3)
    first = replace(first, trace=first.trace[np.clip(np.arange(N) + early, 0, N - 1)])
    prepared = prepare(first)
    assert prepared.laid.early_s == pytest.approx(early * TS)
    rest = prepared.record.rest
    again = rest_along(prepared, prepared.record, first.trace)
    assert np.std(rest) > 0.1
    assert again[100:] == pytest.approx(rest[100:], abs=1e-3 * np.std(rest))


def test_without_a_trace_of_the_second_recording_a_curved_simulation_is_not_judged_there() -> None:
    said = explain(loop("first", 3), replace(loop("second", 8), trace=None))
    assert said.validation is None
    assert "second_not_simulated" in codes(said)


def test_a_simulation_that_is_hardly_curved_is_judged_without_that_and_it_is_said() -> None:
    said = explain(loop("first", 3, 0.002), replace(loop("second", 8, 0.002), trace=None))
    assert judged(said).refitted.rmse < 0.4
    assert "second_not_simulated" in codes(said)


def test_a_linear_simulation_lacks_nothing() -> None:
    said = explain(loop("first", 3, 0.0), replace(loop("second", 8, 0.0), trace=None))
    assert judged(said).refitted.rmse < 0.4
    assert "second_not_simulated" not in codes(said)


def test_along_a_trace_that_is_shorter_than_it_is_late_nothing_is_known() -> None:
    first = loop("first", 3)
    prepared = prepare(replace(first, trace=first.trace[np.clip(np.arange(N) + 12, 0, N - 1)]))
    laid = replace(prepared.laid, early_s=-2.0 * N * TS)
    assert rest_along(replace(prepared, laid=laid), prepared.record, first.trace) is None
