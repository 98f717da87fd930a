"""Whether corners come from outside: a load that turns by its own time, against a valve that lets go by OP's travel."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.engine.causality.outside_corners import LEAST_RATIO, OutsideCorners, outside_corners
from app.engine.recording import Recording, UniformRecord
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop
from tests.audited import audited

INTERVAL_S, SAMPLES = 10.0, 1600


def teeth(seed: int) -> Signal:
    """A load that builds up for some 100 samples and falls away within 10, no two teeth as high."""
    rng = np.random.default_rng(seed)
    at, height = 0.0, 0.0
    steps: list[tuple[float, float]] = []
    while at < INTERVAL_S * SAMPLES:
        for samples, reached in ((100.0, rng.uniform(8.0, 16.0)), (10.0, rng.uniform(-1.0, 1.0))):
            lasts = int(samples * rng.uniform(0.95, 1.05))
            ramp = np.linspace(height, reached, lasts + 1)[1:]
            steps += [(at + INTERVAL_S * k, float(to)) for k, to in enumerate(np.diff(ramp, prepend=height))]
            at, height = at + INTERVAL_S * lasts, float(reached)
    return Signal(steps=tuple(steps), noise_sd=0.1, noise_tau_s=300.0)


def loop(load: Signal, seed: int, valve: TwoParameterValve | None = None) -> Recording:
    spec = LoopSpec(
        plant=first_order(1.0, 30.0, 5.0), controller=Pid(0.6, 60.0), noise=Signal(noise_sd=0.1), load=load,
        pv_start=50.0, op_start=50.0, op_limits=(-100.0, 200.0), step_s=2.0,
    )  # fmt: skip
    spec = spec if valve is None else replace(spec, valve=valve)
    return simulate_loop(spec, INTERVAL_S * SAMPLES, INTERVAL_S, seed).recording("corners")


@cache
def shaken(seed: int) -> Recording:
    """A healthy flow under such teeth."""
    return loop(teeth(seed), seed)


@cache
def cycling(seed: int, S: float = 6.0, J: float = 4.0) -> Recording:
    """The same flow in the limit cycle of its own valve."""
    return loop(Signal(value=2.0, noise_sd=0.1, noise_tau_s=300.0), seed, TwoParameterValve(S, J))


def uniform(made: Recording) -> UniformRecord:
    return UniformRecord(INTERVAL_S, made.pv, made.op, made.sp, np.zeros(made.samples, bool))


def asked(made: Recording) -> OutsideCorners:
    found = outside_corners(uniform(made), period_s_of(made))
    assert found is not None
    return found


def period_s_of(made: Recording) -> float:
    oscillation = audited(made).oscillation
    assert oscillation is not None
    assert oscillation.period_s is not None
    return oscillation.period_s


def test_saw_teeth_from_outside_are_told_from_a_limit_cycle() -> None:
    outside, own = [asked(shaken(seed)) for seed in range(4)], [asked(cycling(seed)) for seed in range(4)]
    assert all(one.shown for one in outside)
    assert not any(one.shown for one in own)
    for part in ("stem_over_turns", "time_over_travel"):
        assert max(getattr(one, part) for one in outside) < 1.5 < min(getattr(one, part) for one in own)


def test_a_healthy_valve_under_saw_teeth_is_accused_and_not_relied_on() -> None:
    judged = [audited(shaken(seed)).judgement for seed in range(4)]
    assert {(one.verdict, one.reliability) for one in judged} == {("stiction", "not_reliable")}
    for one in judged:
        (reason,) = (reason for reason in one.reasons if reason.code == "outside_corners")
        assert reason.measured is not None
        assert reason.measured.statistic < reason.measured.threshold == LEAST_RATIO


def test_a_limit_cycle_is_relied_on_as_before() -> None:
    judged = [audited(cycling(seed)).judgement for seed in range(4)]
    assert {(one.verdict, one.reliability) for one in judged} == {("stiction", "reliable")}


@pytest.mark.parametrize("J", [3.0, 5.0])
def test_valves_that_jump_by_half_and_by_most_of_their_band_are_not_taken_for_a_load(J: float) -> None:
    assert not any(asked(cycling(seed, J=J)).shown for seed in range(2))


@pytest.mark.parametrize("make", [shaken, cycling])
def test_units_signs_and_the_length_of_a_sample_are_free(make) -> None:
    record, period_s = uniform(make(0)), period_s_of(make(0))
    other = replace(
        record, sampling_interval_s=2.0, pv=40.0 - 3.0 * record.pv, sp=None, op=-0.01 * record.op - 3.0
    )  # fmt: skip
    told = outside_corners(replace(record, sp=None), period_s)
    again = outside_corners(other, period_s / 5.0)
    assert told is not None
    assert again is not None
    assert again.stem_over_turns == pytest.approx(told.stem_over_turns, rel=1e-3)
    assert again.time_over_travel == pytest.approx(told.time_over_travel, rel=1e-6)


def test_nothing_is_said_of_coarse_or_few_cycles_of_few_legs_and_of_what_stands() -> None:
    record, period_s = uniform(shaken(0)), period_s_of(shaken(0))
    assert outside_corners(record, 29.0 * INTERVAL_S) is None
    assert outside_corners(record.part(slice(0, 250)), period_s) is None
    assert outside_corners(record, record.samples * INTERVAL_S / 7.9) is None
    assert outside_corners(record, record.samples * INTERVAL_S / 8.1) is not None
    assert outside_corners(replace(record, op=np.full(record.samples, 50.0)), period_s) is None


def test_what_speaks_for_the_valve_makes_the_ratio_large() -> None:
    assert OutsideCorners(1.0, 1.0).shown
    assert not OutsideCorners(LEAST_RATIO, 1.0).shown
    assert OutsideCorners(3.0, 0.2).shown
    assert not OutsideCorners(1.0, 4.0).shown
    assert OutsideCorners(2.0, 4.0).ratio == pytest.approx(4.0)
