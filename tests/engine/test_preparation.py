"""Which stretch of a recording is judged: all that is fit, or the rest of a set point that hides a limit cycle."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from app.engine import preparation
from app.engine.audit import audit
from app.engine.oscillation import Oscillation, detect
from app.engine.preparation import _can_be_limit_cycle, prepare
from app.engine.recording import Recording
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, Wave, first_order, simulate_loop

STICKY = LoopSpec(
    plant=first_order(1.0, 20.0, 5.0),
    controller=Pid(1.2, 20.0),
    valve=TwoParameterValve(5.0, 3.0),
    load=Signal(value=3.0),
    noise=Signal(noise_sd=0.05),
    pv_start=50.0,
    op_start=50.0,
    op_limits=(-1e3, 1e3),
    settle_s=600.0,
)
SAMPLES, MOVE_AT = 2500, 1500


def recorded(spec: LoopSpec, moved: float, at: float = MOVE_AT) -> Recording:
    stepped = replace(spec, sp=Signal(steps=((at, moved),)))
    return simulate_loop(stepped, float(SAMPLES), 1.0, 1).recording("loop")


def healthy() -> LoopSpec:
    return replace(STICKY, valve=LoopSpec(STICKY.plant, STICKY.controller).valve)


@pytest.mark.parametrize("moved", [30.0, 100.0, -300.0])
def test_a_limit_cycle_is_judged_where_the_set_point_that_hides_it_rests(moved: float):
    loop = recorded(STICKY, moved)
    prepared = prepare(loop)
    assert prepared.rest_of is not None
    assert prepared.rest_of.samples == SAMPLES
    assert prepared.fitness.audited.samples == pytest.approx(MOVE_AT, abs=1)

    answer = audit(loop)
    assert (answer.judgement.verdict, answer.judgement.reliability) == ("stiction", "reliable")
    assert (answer.window.start_s, answer.window.samples) == (0.0, prepared.fitness.audited.samples)
    assert "on 60 % of the record" in next(
        reason.text for reason in answer.judgement.reasons if reason.code == "set_point_rests"
    )


def test_all_is_judged_where_the_set_point_hides_nothing():
    loop = recorded(STICKY, 0.0)
    prepared = prepare(loop)
    assert prepared.rest_of is None
    assert prepared.fitness.audited.samples == SAMPLES
    assert "set_point_rests" not in {reason.code for reason in audit(loop).judgement.reasons}


def test_all_is_judged_where_nothing_cycles_while_the_set_point_rests():
    prepared = prepare(recorded(healthy(), 30.0))
    assert prepared.rest_of is None
    assert prepared.fitness.audited.samples == SAMPLES


def test_a_recording_that_is_not_fit_has_no_oscillation():
    prepared = prepare(Recording("flat", np.arange(500.0), np.full(500, 3.0), np.full(500, 4.0)))
    assert prepared.oscillation is None
    assert not prepared.fitness.auditable


@pytest.mark.parametrize("samples", [2300, 2500])
def test_a_rest_begins_where_pv_and_op_have_settled(samples: int):
    loop = recorded(STICKY, 30.0, at=900.0).part(slice(samples))
    start_s = prepare(loop).fitness.audited.start_s
    assert 910.0 < start_s < 1200.0

    answer = audit(loop)
    assert (answer.judgement.verdict, answer.judgement.reliability) == ("stiction", "reliable")
    assert answer.window.start_s == start_s


def test_what_the_valve_did_while_the_set_point_moved_is_no_episode():
    moves = tuple((9000.0 + 400.0 * k, 60.0 * (-1.0) ** k) for k in range(28))
    loop = simulate_loop(replace(STICKY, sp=Signal(steps=moves)), 20000.0, 1.0, 1).recording("loop")
    answer = audit(loop)
    assert (answer.judgement.verdict, prepare(loop).fitness.audited.samples) == ("stiction", 9000)
    assert not answer.episodes.found


def test_a_set_point_that_creeps_does_not_rest():
    loop = simulate_loop(replace(STICKY, sp=Signal(drift_per_s=0.03)), float(SAMPLES), 1.0, 1).recording("loop")
    assert prepare(loop).rest_of is None


def test_a_set_point_rests_where_only_noise_moves_it():
    loop = recorded(STICKY, 30.0)
    noise = 0.02 * np.random.default_rng(3).standard_normal(loop.samples)
    prepared = prepare(replace(loop, sp=loop.sp + noise))
    assert prepared.rest_of is not None
    assert prepared.fitness.audited.samples == pytest.approx(MOVE_AT, abs=3)


@pytest.mark.parametrize("odd", [0.0, 1e6])
def test_a_single_odd_sample_ends_no_rest(odd: float):
    loop = recorded(STICKY, 30.0)
    sp = loop.sp.copy()
    sp[700] = odd
    prepared = prepare(replace(loop, sp=sp))
    assert prepared.rest_of is not None
    assert prepared.fitness.audited.samples == pytest.approx(MOVE_AT, abs=3)


def test_a_rest_that_could_not_be_audited_by_itself_is_not_judged_alone():
    """Its ripple has too few samples a cycle to have a shape."""
    rippled = replace(healthy(), noise=Signal(waves=(Wave(0.5, 3.3),), noise_sd=0.05))
    loop = recorded(rippled, 60.0)
    assert prepare(loop).rest_of is None
    assert audit(loop).judgement.verdict == "no_stiction"


def test_a_rest_under_on_off_control_is_not_judged_alone():
    """OP is switched between two values while the set point rests, and runs through others afterwards."""
    t = np.arange(float(SAMPLES))
    phase = t / 60.0 % 1.0
    switched = np.where(phase < 0.5, 40.0, 60.0)
    op = np.where(t < MOVE_AT, switched, 50.0 + 20.0 * np.sin(t / 17.0))
    pv = np.where(t < MOVE_AT, 4.0 * np.abs(phase - 0.5), 100.0 + np.sin(t / 17.0 - 1.0))
    sp = np.where(t < MOVE_AT, 1.0, 100.0)
    whole = Recording("loop", t, pv, op, sp=sp)
    rest = prepare(whole.part(slice(MOVE_AT))).fitness
    assert [finding.code for finding in rest.refusals] == ["op_two_values"]
    assert _can_be_limit_cycle(detect(rest.record))
    assert prepare(whole).fitness.auditable
    assert prepare(whole).rest_of is None


@pytest.mark.parametrize(("per_cycle", "spoken_for"), [(3.0, False), (40.0, True)])
def test_a_stretch_that_could_not_be_audited_by_itself_speaks_for_nothing(monkeypatch, per_cycle, spoken_for):
    fitness = prepare(recorded(STICKY, 0.0)).fitness
    swing = Oscillation(per_cycle, 5.0, 0.9, per_cycle, 50.0, "pv", 0.0)
    stretch = SimpleNamespace(record=fitness.record, whole=None, oscillation=swing)
    monkeypatch.setattr(preparation, "speaking_stretch", lambda record, oscillation, _: stretch)
    found = preparation._spoken_for(fitness, swing, None, None)
    assert (found is not None) == spoken_for


def test_the_checks_of_a_rest_are_its_own():
    """Beside a step of 100 a PV of two levels has fifty."""
    coarse = recorded(replace(healthy(), pv_resolution=3.0), 100.0)
    prepared = prepare(coarse)
    assert prepared.rest_of is not None
    assert "pv_quantised" in {finding.code for finding in prepared.fitness.findings if finding.outcome == "fail"}


def frozen(loop: Recording, which: slice) -> Recording:
    """PV dead there while OP goes on."""
    pv = loop.pv.copy()
    pv[which] = pv[which.start]
    return replace(loop, pv=pv)


def test_how_a_recording_ended_is_told_of_it_and_not_of_the_rest_that_is_judged():
    loop = recorded(STICKY, 30.0)
    ended = prepare(frozen(loop, slice(2200, SAMPLES)))
    assert ended.rest_of is not None
    assert ended.fitness.audited.samples == pytest.approx(MOVE_AT, abs=1)
    assert ended.fitness.pv_dead_s == pytest.approx(SAMPLES - 2200, abs=2)
    judgement = audit(frozen(loop, slice(2200, SAMPLES))).judgement
    assert "pv_stands" in {reason.code for reason in judgement.reasons}
    assert judgement.unanswered_since_s == pytest.approx(2200, abs=2)


def test_pv_that_stood_till_the_set_point_moved_is_not_dead_at_the_end():
    again = prepare(frozen(recorded(STICKY, 30.0), slice(1300, MOVE_AT)))
    assert again.rest_of is not None
    assert again.fitness.pv_dead_s is None
