"""A second recording that no fit has seen: what is judged of it, and what of it belongs to no model."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, explain
from app.engine.mismatch.judge.result import Improvement
from app.engine.mismatch.judge.validation import beginning
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import library
from app.errors import DataError
from tests.engine.plain_loop import GIVEN, TS, N, moves, noise, recorded

pytestmark = pytest.mark.usefixtures("one_competition")
BAD = slice(700, 703)


@pytest.fixture(scope="module")
def first() -> Comparison:
    return Comparison("first", TS, 40.0 + moves(), recorded(moves()), simulation=GIVEN)


@pytest.fixture(scope="module")
def second() -> Comparison:
    other = moves(seed=8)
    return Comparison("second", TS, 40.0 + other, recorded(other, noise(9) - noise()))


@pytest.fixture(scope="module")
def judged(first: Comparison, second: Comparison) -> Improvement:
    return validated(first, second)


def validated(first: Comparison, second: Comparison) -> Improvement:
    told = explain(first, second).validation
    assert told is not None
    return told


def with_bad(second: Comparison, marked: bool) -> Comparison:
    pv, known = second.pv.copy(), np.ones(N, dtype=np.bool_)
    pv[BAD], known[BAD] = -9999.0, False
    return replace(second, pv=pv, known=known if marked else None)


@pytest.mark.parametrize("marked", [True, False])
def test_bad_samples_are_not_judged(first: Comparison, second: Comparison, judged: Improvement, marked: bool) -> None:
    """Marked as unknown, or wild as a code for a bad value is; both are left out of the first record too."""
    told = validated(first, with_bad(second, marked))
    assert told.explained.fit_pct == pytest.approx(judged.explained.fit_pct, abs=0.5)
    assert [(w.start_s, w.end_s) for w in told.held_out] == [(0.0, 700 * TS), (703 * TS, N * TS)]


def test_what_was_left_out_of_the_second_recording_is_said(first: Comparison, second: Comparison) -> None:
    said = [reason for reason in explain(first, with_bad(second, False)).evidence if reason.code == "wild_samples"]
    assert len(said) == 1
    assert said[0].text.startswith("in the second recording: 3 samples")


def test_a_stuck_sensor_is_not_judged(first: Comparison, second: Comparison, judged: Improvement) -> None:
    pv = second.pv.copy()
    pv[600:900] = pv[600]
    told = validated(first, replace(second, pv=pv))
    assert told.explained.rmse == pytest.approx(judged.explained.rmse, rel=0.1)
    assert not any(w.start_s < 700 * TS < w.end_s for w in told.held_out)


def test_the_whole_is_judged_as_benchmarks_do(judged: Improvement) -> None:
    assert [(w.start_s, w.end_s) for w in judged.held_out] == [(0.0, N * TS)]


def test_the_beginning_is_a_tenth_of_what_is_compared() -> None:
    usable = np.ones(100, dtype=np.bool_)
    usable[:40] = usable[50:60] = False
    assert np.flatnonzero(beginning(usable)).tolist() == list(range(40, 45))
    assert beginning(np.ones(1000, dtype=np.bool_)).sum() == 100


def test_a_second_recording_of_which_next_to_nothing_is_known_is_refused(first: Comparison, second: Comparison) -> None:
    known = np.arange(N) < 5
    with pytest.raises(DataError, match="PV changes 4 times in 5 samples") as refused:
        explain(first, replace(second, known=known))
    assert refused.value.code == "signal_constant"


def test_only_states_that_a_record_began_with_begin_anew() -> None:
    u = np.sin(np.arange(200) / 5.0)
    context = Context(experiment(1.0, u, u, measured=(("AUX", u**2),)), Plant(1.0, 5.0, 2.0, tau2=2.0))
    parts = [Part(block, block.starts(context, u)[0]) for block in library(context.record)]
    begin = {p.name for part in parts for p in part.block.parameters(context) if p.begins}
    assert begin == {"stem_start", "upper_start"}


def test_a_given_model_is_simulated_on_the_second_recording(first: Comparison, judged: Improvement) -> None:
    """It runs there a little farther off than its refit does: only the start is fitted to it."""
    assert judged.given is not None
    assert judged.refitted.rmse < judged.given.rmse < 1.5 * judged.refitted.rmse


def test_a_simulation_of_one_recording_alone_is_not_judged_on_the_other(first: Comparison, second: Comparison) -> None:
    alone = replace(first, simulation=None)
    said = explain(alone, replace(second, trace=second.pv))
    assert said.validation is not None
    assert said.validation.given is None
    assert "given_not_validated" in [reason.code for reason in said.evidence]


def test_what_the_second_recording_lacks_is_said_of_it(first: Comparison, second: Comparison) -> None:
    with pytest.raises(DataError, match="in the second recording: PV is constant"):
        explain(first, replace(second, pv=np.full(N, 50.0)))
