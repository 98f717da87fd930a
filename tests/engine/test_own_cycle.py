"""Whether a cycle is the valve's own: what comes from outside in corners and ramps has the shapes, not the stem."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.engine.causality.own_cycle import CLEAR_NATS, TELLING, OwnCycle, own_cycle
from app.engine.recording import Recording, UniformRecord
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop
from tests.audited import audited


@cache
def shaken(seed: int, samples: int = 4000) -> Recording:
    """A healthy flow whose load goes up and down as what a neighbour's valve makes: corners, no two legs as long."""
    rng = np.random.default_rng(seed)
    up = np.repeat(np.arange(2000) % 2 == 1, np.round(75.0 * rng.uniform(0.8, 1.2, 2000)).astype(int))
    slope = np.resize(np.where(up, 0.12, -0.12), samples)
    steps = tuple((10.0 * k, float(change)) for k, change in enumerate(slope - slope.mean()))
    spec = LoopSpec(
        plant=first_order(1.0, 30.0, 5.0), controller=Pid(0.6, 40.0), noise=Signal(noise_sd=0.1),
        load=Signal(steps=steps, noise_sd=0.1, noise_tau_s=300.0), pv_start=50.0, op_start=50.0,
        op_limits=(-100.0, 200.0), step_s=2.0,
    )  # fmt: skip
    return simulate_loop(spec, 10.0 * samples, 10.0, seed).recording("shaken")


@cache
def cycling(seed: int, S: float = 6.0, J: float = 5.0, samples: int = 4000) -> Recording:
    """The same flow in the limit cycle of its own valve."""
    spec = LoopSpec(
        plant=first_order(1.0, 30.0, 5.0), controller=Pid(0.6, 40.0), noise=Signal(noise_sd=0.1),
        valve=TwoParameterValve(S, J), load=Signal(value=2.0, noise_sd=0.1, noise_tau_s=300.0),
        pv_start=50.0, op_start=50.0, op_limits=(-100.0, 200.0), step_s=2.0,
    )  # fmt: skip
    return simulate_loop(spec, 10.0 * samples, 10.0, seed).recording("cycling")


def uniform(made: Recording) -> UniformRecord:
    return UniformRecord(10.0, made.pv, made.op, made.sp, np.zeros(made.samples, bool))


def asked(made: Recording) -> OwnCycle:
    found = audited(made)
    assert found.oscillation is not None
    return own_cycle(uniform(made), found.oscillation.period_s)


def test_what_a_load_shapes_is_told_from_what_the_valve_does() -> None:
    outside = [asked(shaken(seed)) for seed in range(6)]
    assert sum(one.missed for one in outside) >= 4
    assert not any(one.shown for one in outside)
    own = [asked(cycling(seed)) for seed in range(6)]
    assert all(one.shown for one in own)
    assert min(one.nats_a_cycle for one in own) >= CLEAR_NATS


def test_a_valve_that_has_begun_to_stick_does_not_all_the_time_but_is_not_missed() -> None:
    part = cycling(0, samples=2700)
    outside = shaken(0, samples=1300)
    joined = UniformRecord(
        10.0, np.append(outside.pv, part.pv), np.append(outside.op, part.op), None, np.zeros(4000, bool)
    )
    found = own_cycle(joined, 1500.0)
    assert not found.all_the_time
    assert found.lately
    assert not found.missed
    assert own_cycle(uniform(part), 1500.0).all_the_time


@pytest.mark.parametrize("J", [0.0, 1.0, 3.0, 6.0])
def test_valves_that_slip_and_valves_that_jump_are_not_missed(J: float) -> None:
    assert not any(asked(cycling(seed, J=J, samples=3000)).missed for seed in range(3))


def test_units_and_signs_are_free() -> None:
    for made in (shaken(0), cycling(0)):
        found = audited(made)
        assert found.oscillation is not None
        record, period_s = uniform(made), found.oscillation.period_s
        other = replace(record, pv=-40.0 * record.pv, sp=-40.0 * made.sp, op=-0.01 * record.op - 3.0)
        told, again = own_cycle(record, period_s), own_cycle(other, period_s)
        assert again.nats_a_cycle == pytest.approx(told.nats_a_cycle, rel=1e-3)
        assert (again.shown, again.missed, again.means) == (told.shown, told.missed, told.means)


def test_a_healthy_valve_under_triangles_is_not_accused_reliably() -> None:
    judged = [audited(shaken(seed)).judgement for seed in range(4)]
    assert {one.verdict for one in judged} == {"stiction"}
    assert min(one.stiction_probability or 0.0 for one in judged) > 0.9
    assert all("foreign_cycle" in [reason.code for reason in one.reasons] for one in judged)
    assert {one.reliability for one in judged} == {"not_reliable"}


def test_a_long_record_does_not_make_the_cycle_the_valves() -> None:
    found = [asked(shaken(seed, samples=24_000)) for seed in range(3)]
    assert all(one.missed for one in found)
    assert not any(asked(cycling(seed, samples=24_000)).missed for seed in range(2))


def test_a_limit_cycle_is_accused_as_before() -> None:
    judged = [audited(cycling(seed)).judgement for seed in range(4)]
    assert {(one.verdict, one.reliability) for one in judged} == {("stiction", "reliable")}
    assert not any(reason.code == "foreign_cycle" for one in judged for reason in one.reasons)


def test_a_short_record_or_few_cycles_are_not_held_against_a_loop() -> None:
    found = audited(shaken(0))
    assert found.oscillation is not None
    record, period_s = uniform(shaken(0)), found.oscillation.period_s
    short = own_cycle(record.part(slice(0, 1900)), period_s)
    few = own_cycle(record, 20.0 * period_s)
    assert not short.shown
    assert 0 < short.means < TELLING < few.means
    assert not short.missed
    assert not few.missed


def test_where_nothing_moves_nothing_is_said() -> None:
    record = uniform(cycling(0))
    for still in (replace(record, op=np.full(record.samples, 50.0)), replace(record, pv=np.full(record.samples, 1.0))):
        assert own_cycle(still, 1500.0) == OwnCycle()
    assert own_cycle(record.part(slice(0, 0)), 1500.0) == OwnCycle()
    line = np.linspace(0.0, 1.0, record.samples)
    assert not own_cycle(replace(record, pv=line, op=line), 1500.0).shown
    assert not own_cycle(record.part(slice(0, 3)), 1500.0).missed


@pytest.mark.parametrize(
    ("found", "shown", "missed"),
    [
        (OwnCycle(0.5, True, True, 1000, 15.0, True), True, False),
        (OwnCycle(0.49, True, True, 1000, 15.0, True), False, True),
        (OwnCycle(0.49, True, True, 1000, 15.0, False), False, False),
        (OwnCycle(0.9, False, True, 1000, 15.0, True), False, False),
        (OwnCycle(0.9, False, False, 1000, 15.0, True), False, True),
        (OwnCycle(0.9, False, False, 1000, 15.0, False), False, True),
        (OwnCycle(0.0, False, False, 999, 15.0, True), False, False),
        (OwnCycle(0.0, False, False, 1000, 14.9, True), False, False),
        (OwnCycle(), False, False),
    ],
)
def test_what_is_shown_and_what_is_missed(found: OwnCycle, shown: bool, missed: bool) -> None:
    assert (found.shown, found.missed) == (shown, missed)


@pytest.mark.parametrize(("period_s", "fine"), [(600.0, True), (590.0, False)])
def test_sixty_samples_a_cycle_are_fine(period_s: float, fine: bool) -> None:
    assert own_cycle(uniform(cycling(0)), period_s).fine is fine


@pytest.mark.parametrize("change", [lambda pv: pv + 70.0, lambda pv: -1.8 * pv + 32.0])
def test_a_set_point_in_another_unit_than_pv_changes_nothing(change) -> None:
    for made in (shaken(0), cycling(0)):
        record = uniform(made)
        given, other = own_cycle(record, 1500.0), own_cycle(replace(record, pv=change(record.pv)), 1500.0)
        assert (other.shown, other.missed) == (given.shown, given.missed)
        if not given.shown:  # else it may have been shown by another stride
            assert other.nats_a_cycle == pytest.approx(given.nats_a_cycle, rel=0.05)  # SP is where PV mostly is
