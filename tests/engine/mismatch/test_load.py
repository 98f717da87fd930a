"""A load that nobody recorded: beside a linear loop of our own it says nothing against the physics that OP shows."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, explain
from app.engine.mismatch.compete.restarting import STICKS
from app.engine.mismatch.compete.worth import nearer, no_worse
from app.engine.mismatch.fit.fitting import Fit, fit_linear
from app.engine.mismatch.fit.free_run import (
    CLEARLY,
    beside_load,
    error_left,
    free_run_error,
    left_by,
    runs_nearer,
    stem_swing,
)
from app.engine.mismatch.fit.task import OWN_DEVIATION, Given
from app.engine.mismatch.judge.holdout import FreeRuns, ran_worse, unseen_errors
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import library
from app.engine.recording import FloatArray
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, integrator, simulate_loop
from tests.engine.sticking_loop import SAMPLES, TS, compared, loop

N, PERIOD = 1200, 24
PLANT = Plant(1.0, 20.0, 5.0)
OWN = Given(PLANT, OWN_DEVIATION)
BEHIND_STEM = replace(OWN, behind_stem=True)
S = 0.6
MOVED = ((0.0, 1.0), (900.0, 7.0), (2100.0, -9.0), (2700.0, 4.0), (4300.0, -8.0), (5200.0, 6.0))


def steps() -> FloatArray:
    return np.repeat([0.0, 8.0, -5.0, 3.0], N // 4)


def swinging() -> FloatArray:
    rng = np.random.default_rng(3)
    return np.sin(2.0 * np.pi * np.arange(N) / PERIOD) + 0.05 * rng.standard_normal(N)


def standing_off(given: Given, share: float, by: float = 1.0) -> Fit:
    """A stem of which J / S is `share`, whose free run leaves noise of 0.1 beside a load; OP swings and answers it."""
    rng = np.random.default_rng(4)
    found = fit_linear(experiment(TS, 50.0 + swinging() - steps(), 50.0 + swinging()), Given(PLANT))
    stem = Part(next(b for b in library(found.record) if b.name == STICKS), np.array([S, share, 0.0]))
    simulated = found.record.pv_deviation + 0.1 * rng.standard_normal(N) - by * steps()
    return replace(found, given=given, parts=(stem,), simulated=simulated)


def test_the_swing_of_a_stem_is_counted_by_its_turns_whatever_steps_beside_it() -> None:
    """Noise that is less than S turns no stem."""
    assert np.std(steps()) > 5.0 * np.std(swinging())
    assert stem_swing(standing_off(BEHIND_STEM, 0.5)) == pytest.approx(PERIOD, rel=0.05)


@pytest.mark.parametrize(("given", "share"), [(OWN, 0.5), (BEHIND_STEM, 0.1), (BEHIND_STEM, 0.0)])
def test_a_load_is_asked_only_behind_a_stem_that_slips(given: Given, share: float) -> None:
    assert stem_swing(standing_off(given, share)) is None
    assert stem_swing(standing_off(BEHIND_STEM, 0.2)) is not None


def test_a_stem_that_noise_turns_has_no_swing() -> None:
    found = standing_off(BEHIND_STEM, 0.5)
    tiny = replace(found.parts[0], values=np.array([0.1, 0.5, 0.0]))
    noise = np.random.default_rng(6).standard_normal(N)
    assert stem_swing(replace(found, parts=(tiny,), record=found.record.with_op(50.0 + noise))) is None


def test_a_load_is_taken_from_what_a_free_run_leaves() -> None:
    found = standing_off(OWN, 0.5)
    left = beside_load(found.residual, found.record.usable, PERIOD)
    assert left[0] != 0.0  # the median is of more than the first sample
    assert left[-1] != 0.0
    assert np.std(found.residual) > 30.0 * np.std(left)
    assert np.std(left) == pytest.approx(0.1, rel=0.1)
    assert free_run_error(found) == pytest.approx(np.std(found.residual))
    assert free_run_error(found, PERIOD) == pytest.approx(np.std(left), rel=0.05)
    walking = replace(found, given=replace(OWN, integrating=True))
    assert free_run_error(walking, PERIOD) == free_run_error(found, PERIOD)
    assert free_run_error(walking) != free_run_error(found)


def test_the_swing_itself_is_no_load() -> None:
    every = np.ones(N, dtype=np.bool_)
    assert np.std(beside_load(swinging(), every, PERIOD)) == pytest.approx(np.std(swinging()), rel=0.05)


def test_samples_that_are_not_compared_are_no_load() -> None:
    found = standing_off(OWN, 0.5, by=0.0)
    spoiled, seen = found.residual.copy(), np.ones(N, dtype=np.bool_)
    spoiled[500:530], seen[500:530] = 1e6, False
    assert np.max(np.abs(beside_load(spoiled, seen, PERIOD)[seen])) < 1.0
    nothing = np.zeros(N, dtype=np.bool_)
    assert np.array_equal(beside_load(spoiled, nothing, PERIOD), spoiled)


def test_a_load_says_nothing_of_which_of_two_loops_is_right() -> None:
    """The stem's free run stands off by all of the load and holds the swing; the loop found from OP took the load."""
    from_op = standing_off(OWN, 0.5, by=0.0)
    from_op = replace(from_op, simulated=from_op.simulated - 0.5 * swinging())
    stem, other = standing_off(BEHIND_STEM, 0.5), standing_off(OWN, 0.5)
    assert no_worse(stem, from_op)
    assert nearer(stem, from_op)
    assert not no_worse(other, from_op)
    assert not no_worse(stem, replace(from_op, given=BEHIND_STEM))  # beside one loop a load is what it is


@pytest.mark.parametrize(("given", "is_worse"), [(BEHIND_STEM, False), (OWN, True)])
def test_unseen_data_are_judged_beside_a_load_too(given: Given, is_worse: bool) -> None:
    """The refit leaves all of the swing, the explained model none of it, but stands off by the load."""
    found = standing_off(given, 0.5)
    pv, held = found.record.pv, np.arange(N) >= 0.7 * N
    run = FreeRuns(pv + swinging(), pv + 3.0 * steps(), held, -1.0, found, ())
    assert ran_worse(pv, run) is is_worse
    errors = unseen_errors(pv, run)
    assert errors.refitted == pytest.approx(np.sqrt(0.5), rel=0.1)
    assert (errors.explained > errors.refitted) is is_worse


@pytest.fixture(scope="module")
def under_steps() -> Explanation:
    return explain(compared(loop(2, 6.0, 4.5, MOVED, samples=N)))


def test_a_valve_that_sticks_under_steps_of_the_load_is_named_and_sized(under_steps: Explanation) -> None:
    stem = under_steps.effects[0]
    assert stem.code == "valve.stiction"
    assert [p.value for p in stem.parameters[:2]] == pytest.approx([6.0, 4.5], rel=0.05)
    assert all(effect.code == "disturbance.step" for effect in under_steps.effects[1:])


def test_a_free_run_that_stands_off_by_the_load_says_so(under_steps: Explanation) -> None:
    assert under_steps.fit.explained.rmse > under_steps.fit.refitted.rmse
    (why,) = [reason.text for reason in under_steps.evidence if reason.code == "held_out_worse"]
    assert "an unrecorded load offsets both" in why


def test_the_stem_of_a_long_record_under_steps_stands_on_the_whole_of_it(competing_on: Callable[[int], None]) -> None:
    competing_on(1000)
    said = explain(compared(loop(2, 6.0, 4.5, MOVED, samples=N)))
    assert [effect.code for effect in said.effects][:1] == ["valve.stiction"]
    assert said.effects[0].parameters[0].value == pytest.approx(6.0, rel=0.02)


def level(
    S: float, J: float, gain: float, tuned: Pid, noise: float, load: tuple[tuple[float, float], ...]
) -> Comparison:
    """An integrating process under PI control whose load steps."""
    spec = LoopSpec(
        plant=integrator(gain, 2.0),
        controller=tuned,
        valve=TwoParameterValve(S, J),
        load=Signal(steps=((0.0, 1.0), *load)),
        noise=Signal(noise_sd=noise),
        pv_start=50.0,
        op_start=50.0,
        op_limits=(0.0, 100.0),
    )
    return compared(simulate_loop(spec, SAMPLES * TS, TS, 5002))


SEVEN = ((2011, -3.44), (2649, -6.35), (2660, 4.24), (3309, 6.08), (5278, -2.21), (6060, -2.07), (7066, -3.04))
SIX = ((949, -2.55), (2321, -4.89), (4595, -4.31), (5418, 0.76), (5576, -3.97), (6104, -0.24))


@pytest.mark.parametrize(
    ("S", "J", "made"),
    [
        # Its stem shows only under the noise of a load that an integrator sums up.
        (8.0, 4.0, level(8.0, 4.0, 0.002, Pid(10.0, 120.0, 0.0), 0.2, SEVEN)),
        # Its free run is the nearer one only in the swings in which no load steps.
        (5.0, 2.5, level(5.0, 2.5, 0.01, Pid(2.0, 400.0, 0.0), 0.1, SIX)),
    ],
)
def test_a_valve_that_sticks_before_a_level_is_named_under_steps_of_the_load(
    S: float, J: float, made: Comparison
) -> None:
    valve = [effect for effect in explain(made).effects if not effect.code.startswith(("disturbance.", "sensor.drift"))]
    assert [effect.code for effect in valve] == ["valve.stiction"]
    assert [p.value for p in valve[0].parameters[:2]] == pytest.approx([S, J], rel=0.1)


def test_a_step_is_felt_in_one_swing_and_a_wrong_model_in_each() -> None:
    right, wrong = standing_off(BEHIND_STEM, 0.5), standing_off(BEHIND_STEM, 0.5)
    bump = np.where(np.arange(N) < N // 10, 20.0 * np.sin(np.arange(N) * 0.5), 0.0)
    right = replace(right, simulated=right.simulated - bump)
    wrong = replace(wrong, simulated=wrong.simulated - 0.5 * swinging())
    assert np.std(left_by(right, PERIOD)) > 2.0 * np.std(left_by(wrong, PERIOD))
    assert error_left(right, PERIOD) == pytest.approx(0.1, rel=0.1)
    assert runs_nearer(right, wrong, PERIOD)
    assert not runs_nearer(wrong, right, PERIOD)


def test_what_is_not_clearly_nearer_in_a_swing_must_be_nearer_over_all() -> None:
    one, other = standing_off(BEHIND_STEM, 0.5), standing_off(BEHIND_STEM, 0.5)
    other = replace(other, simulated=other.simulated - 0.15 * swinging())
    assert CLEARLY < error_left(one, PERIOD) / error_left(other, PERIOD) < 0.9
    assert runs_nearer(one, other, PERIOD)
    bump = np.where(np.arange(N) < N // 10, 20.0 * np.sin(np.arange(N) * 0.5), 0.0)
    assert not runs_nearer(replace(one, simulated=one.simulated - bump), other, PERIOD)
