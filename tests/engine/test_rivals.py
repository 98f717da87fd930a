"""Rival explanations: each stands out on the loop that it explains, and not on a sticky one."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import sawtooth

from app.engine.evidence import measured_of
from app.engine.features import PER_CYCLE, extract, shape_windows
from app.engine.freerun import through_process, valve_position
from app.engine.oscillation import detect
from app.engine.recording import UniformRecord
from app.engine.rivals import Rival, compete, contest, runner_up, winner
from app.engine.rivals.disturbance import load_disturbance, outside_wave
from app.engine.rivals.jumps import Jumps, jumps
from app.engine.rivals.line import Line, line, worst
from app.engine.rivals.set_point import set_point_following
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, Wave, first_order, simulate_loop

N = 1200
T = np.arange(N)
CYCLE = 2 * np.pi * T / 50


def noise(seed: int, size: float = 1.0) -> np.ndarray:
    return size * np.random.default_rng(seed).normal(size=N)


def rivals(pv, op, sp=None) -> dict[str, Rival]:
    record = UniformRecord(1.0, np.asarray(pv, float), np.asarray(op, float), sp, np.zeros(N, bool))
    oscillation = detect(record)
    return {rival.cause: rival for rival in compete(record, oscillation, extract(record, oscillation))}


def test_op_at_its_limit_while_pv_swings_is_saturation():
    found = rivals(np.sin(CYCLE) + noise(1, 0.01), np.maximum(np.cos(CYCLE), 0.2) + 0.0)
    assert found["saturated_op"].stands_out
    assert found["saturated_op"].counts > 0
    assert found["saturated_op"].statistic == pytest.approx(np.arccos(-0.2) / np.pi, abs=0.02)  # of a cycle at 0.2


def test_pv_on_three_values_is_quantisation():
    found = rivals(np.round(1.2 * np.sin(CYCLE) + noise(2, 0.2)), np.cos(CYCLE) + noise(3, 0.05))
    assert found["quantised_sensor"].stands_out


def test_pv_and_op_that_follow_a_moving_set_point_are_explained_by_it():
    sp = np.cumsum(noise(4))
    found = rivals(sp + noise(5, 0.1), 2 * sp + noise(6, 0.1), sp=sp)
    assert found["set_point_following"].stands_out


@pytest.mark.parametrize(
    ("pv", "op", "misfit_drop", "strength", "counts"),
    [
        (0.7, 0.9, 0.0, 0.5, 0.0),
        (0.9, 0.7, 0.0, 0.5, 0.0),
        (0.4, 0.9, 0.0, 0.0, 0.0),
        (0.9, 0.92, 0.0, 5.0 / 6.0, 0.0),
        (0.92, 0.92, 0.004, 13.0 / 15.0, 1.0),
        (0.92, 0.92, 0.006, 13.0 / 15.0, 0.0),
    ],
)
def test_a_set_point_that_is_behind_all_counts_where_a_sticky_valve_explains_no_more(
    pv, op, misfit_drop, strength, counts
):
    features, record = SimpleNamespace(named={"misfit_drop": misfit_drop}.get), SimpleNamespace(sp=None)
    found = set_point_following(SimpleNamespace(sp=True, from_sp=(pv, op), record=record, features=features))
    assert (found.strength, found.counts) == (pytest.approx(strength), counts)
    assert (found.statistic, found.threshold, found.explained) == (min(pv, op), 0.7, pv)
    assert ("no better" in found.text) == (counts > 0.0)


def told(rival: Rival) -> tuple[float, str, float]:
    """What it rests on, which passes where it stands out."""
    found = measured_of(rival.statistic, rival.operator, rival.threshold)
    assert found.passed == rival.stands_out
    return found.statistic, found.operator, found.threshold


def scene(even: float, follows: float = 0.9, wave: float = 0.0, opposition: float = 0.0) -> SimpleNamespace:
    named = {"ccf_even": even, "ccf_odd": 0.0, "gain": 0.0, "causal_sticky": follows}.get
    swing = SimpleNamespace(regular=True, strength=0.9)
    features = SimpleNamespace(named=named)
    return SimpleNamespace(along_sp=True, features=features, oscillation=swing, wave=wave, opposition=opposition)


@pytest.mark.parametrize(
    ("even", "follows", "rests_on", "text"),
    [
        (0.6, 0.9, (0.6, ">=", 0.5), "OP is in phase or antiphase with PV by 0.60"),
        (0.4, 0.9, (0.4, ">=", 0.5), "OP is in phase or antiphase with PV by 0.40"),
        (0.4, 0.2, (0.2, "<=", 0.3), "even on the data it was fitted to, a sticky valve explains 20 %"),
        (0.0, 0.9, (0.9, "<=", 0.3), "even on the data it was fitted to, a sticky valve explains 90 %"),
    ],
)
def test_a_disturbance_tells_by_what_it_was_found(even, follows, rests_on, text):
    found = load_disturbance(scene(even, follows))
    assert told(found) == rests_on
    assert found.text.startswith(text)


@pytest.mark.parametrize(
    ("even", "wave", "opposition", "rests_on", "text"),
    [
        (0.6, 0.5, 0.0, (0.6, ">=", 0.5), "a regular oscillation, and OP is in phase or antiphase with PV by 0.60"),
        (0.1, 0.9, 0.3, (0.9, ">=", 0.7), "a sine of constant phase explains 90 %"),
        (0.1, 0.9, 0.6, (0.6, "<=", 0.55), "a sine of constant phase explains 90 %"),
        (0.1, 0.6, 0.3, (0.6, ">=", 0.7), "a sine of constant phase explains 60 %"),
    ],
)
def test_a_wave_from_outside_tells_by_what_it_was_found(even, wave, opposition, rests_on, text):
    found = outside_wave(scene(even, wave=wave, opposition=opposition))
    assert told(found) == (pytest.approx(rests_on[0]), rests_on[1], pytest.approx(rests_on[2]))
    assert found.text.startswith(text)
    assert found.explained == wave


def test_a_set_point_that_pv_and_op_go_along_with_tells_so():
    sp = np.cumsum(noise(4))
    features, record = SimpleNamespace(named={"misfit_drop": 0.1}.get), SimpleNamespace(op=2.0 * sp, sp=sp)
    along = SimpleNamespace(sp=True, from_sp=(0.5, 0.5), record=record, features=features, pv_along_sp=0.8)
    found = set_point_following(along)
    assert told(found) == (pytest.approx(0.8), ">=", 0.5)
    assert (found.strength, found.explained) == (pytest.approx(0.8), 0.5)
    assert found.text == "PV and OP follow the set point directly, by 0.80"


def following(S: float, period_s: float) -> dict[str, Rival]:
    """A flow whose set point swings by 20, with a valve of stiction band S."""
    spec = LoopSpec(
        plant=first_order(1.0, 3.0, 1.0),
        controller=Pid(0.6, 4.0),
        valve=TwoParameterValve(S, S),
        sp=Signal(waves=(Wave(20.0, period_s),)),
        noise=Signal(noise_sd=0.1),
        step_s=0.25,
        settle_s=100.0,
    )
    record = simulate_loop(spec, float(N), 1.0, 5).uniform()
    return rivals(record.pv, record.op, record.sp)


def test_a_set_point_behind_all_that_moves_counts_against_stiction_that_explains_nothing():
    found = following(0.0, 120.0)["set_point_following"]
    assert found.strength >= 0.85
    assert found.counts == 1.0
    assert "no better than a linear one" in found.text
    assert following(15.0, 300.0)["set_point_following"].counts == 0.0


def test_op_in_line_with_a_wandering_pv_is_a_disturbance():
    pv = np.convolve(np.random.default_rng(7).normal(size=N + 20), np.ones(21) / 21, "valid")
    assert rivals(pv, -3 * pv + noise(8, 0.01))["disturbance"].stands_out


def taken_back(sp_of=lambda record: None) -> dict[str, Rival]:
    """A load that jumps every 150 s, and a slow integrating controller that takes it back."""
    levels = np.random.default_rng(21).normal(size=9)
    steps = tuple((100.0 + 150.0 * k, 4.0 * size) for k, size in enumerate(np.diff(levels)))
    spec = LoopSpec(
        plant=first_order(1.0, 3.0, 1.0),
        controller=Pid(0.1, 4.0),
        load=Signal(steps=steps),
        noise=Signal(noise_sd=0.02),
        step_s=0.25,
        settle_s=100.0,
    )
    record = simulate_loop(spec, float(N), 1.0, 5).uniform()
    return rivals(record.pv, record.op, sp_of(record))


def test_jumps_of_pv_that_go_back_along_with_op_are_the_loads_and_count_against_stiction():
    found = taken_back()["disturbance"]
    assert found.stands_out
    assert found.counts == 3.0
    assert "the load steps" in found.text


@pytest.mark.parametrize(
    "sp",
    [np.full(N, 5.0), 5.0 + 1e-14 * np.sin(CYCLE), np.where(T == 600.0, 5.01, 5.0)],
    ids=["at rest", "rounding", "one sample"],
)
def test_jumps_of_pv_are_looked_at_where_the_set_point_has_no_part_in_them(sp: np.ndarray):
    assert taken_back(lambda record: sp)["disturbance"].counts == 3.0


def test_jumps_of_pv_are_not_looked_at_where_pv_follows_the_set_point():
    assert taken_back(lambda record: 0.5 * record.pv + noise(23, 0.1))["disturbance"].counts == 0.0


@pytest.mark.parametrize("slip", [0.0, 0.5, 1.0])
def test_jumps_of_a_valve_that_stands_between_them_are_not_the_loads(slip: float):
    triangle = 8.0 * np.abs((T / 100.0) % 1.0 - 0.5) - 2.0
    pv = through_process(valve_position(triangle, 1.5, 1.5 * slip), 2.0) + noise(22, 0.01)
    seen = rivals(pv, triangle)["disturbance"]
    assert seen.counts == 0.0


@pytest.mark.parametrize("seed", [29, 125, 126, 140])
@pytest.mark.parametrize(("scale", "offset"), [(1.0, 1000.0), (0.1, -5.0), (-3.7, 0.0)])
def test_jumps_of_a_coarse_pv_depend_on_no_unit(seed: int, scale: float, offset: float):
    """Many of its steps are alike; which of them are quiet must not be a matter of rounding."""
    pv = np.round(np.cumsum(np.random.default_rng(seed).normal(size=100)) / 2.0)
    op = np.round(-np.cumsum(pv - pv.mean()) / 5.0)
    assert jumps_of(scale * pv + offset, op).taken_back == pytest.approx(jumps_of(pv, op).taken_back, abs=1e-6)


def jumps_of(pv: np.ndarray, op: np.ndarray) -> Jumps:
    record = UniformRecord(1.0, pv, op, None, np.zeros(len(pv), bool))
    return jumps(tuple(shape_windows(record, detect(record))))


def test_pure_sines_in_line_are_tuning_or_a_sine_from_outside():
    found = rivals(np.sin(CYCLE) + noise(9, 0.01), -np.sin(CYCLE) + noise(10, 0.01))
    assert found["tuning_or_sinusoidal_disturbance"].stands_out


def test_white_noise_is_no_oscillation():
    assert rivals(noise(11), noise(12))["no_oscillation"].stands_out


def test_a_sticky_loop_leaves_no_rival_that_counts_against_it():
    square, triangle = np.sign(np.cos(CYCLE + 0.3)), np.arcsin(np.sin(CYCLE))
    found = rivals(square + noise(13, 0.05), triangle + noise(14, 0.01))
    assert not [r.cause for r in found.values() if r.stands_out and r.counts]


@pytest.mark.parametrize("sp", [None, np.full(N, 5.0)])
def test_a_set_point_that_stands_explains_nothing(sp):
    assert rivals(np.sin(CYCLE), np.cos(CYCLE), sp=sp)["set_point_following"].strength == 0.0


def test_rivals_that_stand_out_come_first_the_nearest_cause_first():
    sp = np.cumsum(noise(14))
    ranked = list(rivals(sp + noise(15, 0.1), 2 * sp + noise(16, 0.1), sp=sp).values())
    standing = [rival.stands_out for rival in ranked]
    assert standing == sorted(standing, reverse=True)
    assert ranked[0].cause == "set_point_following"


def test_single_samples_that_jump_away_are_a_spiking_sensor():
    pv = np.convolve(np.random.default_rng(17).normal(size=N + 20), np.ones(21) / 21, "valid")
    pv[50::60] += 3.0
    assert rivals(pv, -pv)["sensor_spikes"].stands_out
    pv[:] = np.repeat(noise(18)[: N // 60], 60)  # steps of a load stay
    assert not rivals(pv + noise(19, 0.01), -pv)["sensor_spikes"].stands_out


def test_pv_that_holds_its_last_digit_while_op_ramps_is_a_sticking_sensor():
    held = np.repeat(np.sin(2 * np.pi * T[::10] / 50) + noise(20, 0.1)[::10], 10)
    found = rivals(held, -np.cumsum(held) + noise(21, 0.01))
    assert found["sensor_sticking"].stands_out
    op_held_too = rivals(held, np.repeat(noise(22)[::10], 10))["sensor_sticking"]
    assert not op_held_too.applies
    assert "not evaluated, because" in op_held_too.text


def test_an_undamped_sine_with_op_against_pv_is_tight_tuning():
    found = rivals(np.sin(CYCLE) + noise(23, 0.01), -np.sin(CYCLE) + noise(24, 0.01))
    assert found["tight_tuning"].stands_out
    assert next(iter(found)) == "tight_tuning"


def test_a_sine_that_the_controller_integrates_comes_from_outside():
    found = rivals(np.sin(CYCLE) + noise(25, 0.01), np.cos(CYCLE) + noise(26, 0.01))
    assert found["external_oscillation"].stands_out
    assert not found["tight_tuning"].stands_out


def linear_loop(tightness: float, load: Signal, seed: int = 3):
    plant = first_order(1.0, 10.0, 5.0)
    spec = LoopSpec(
        plant, Pid(3.5 * tightness, 13.0), noise=Signal(noise_sd=0.02), load=load, step_s=0.5, settle_s=300.0
    )
    loop = simulate_loop(spec, float(N), 1.0, seed)
    return rivals(loop.pv, loop.op, sp=loop.sp)


def test_a_loop_that_rings_under_a_wandering_load_has_an_aggressive_controller():
    load = Signal(noise_sd=1.0, noise_tau_s=30.0)
    assert linear_loop(0.85, load)["aggressive_controller"].stands_out
    assert not linear_loop(0.2, load)["aggressive_controller"].stands_out


def test_a_loop_that_creeps_back_after_steps_has_a_sluggish_controller():
    steps = Signal(steps=((100.0, 4.0), (400.0, -5.0), (700.0, 6.0), (950.0, -3.0)))
    assert linear_loop(0.03, steps)["sluggish_controller"].stands_out
    assert not linear_loop(0.3, steps)["sluggish_controller"].stands_out


def test_a_deadband_is_told_from_a_free_valve_and_from_one_that_slips():
    op = 3.0 * np.arcsin(np.sin(CYCLE)) + 0.5 * np.sin(2 * np.pi * T / 173)
    play = rivals(through_process(valve_position(op, 3.5, 0.0), 1.0) + noise(27, 0.02), op)["backlash"]
    assert play.statistic > play.threshold
    assert not play.stands_out  # it is heard, and names no cause
    assert play.explained > 0.8
    assert not rivals(through_process(op, 3.0), op)["backlash"].applies
    slips = rivals(through_process(valve_position(op, 3.5, 3.5), 1.0) + noise(27, 0.02), op)["backlash"]
    assert slips.statistic < slips.threshold


@given(gain=st.floats(0.01, 100.0), offset=st.floats(-50.0, 50.0), flip=st.sampled_from([-1.0, 1.0]))
@settings(max_examples=15)
def test_no_strength_depends_on_unit_offset_or_sign(gain, offset, flip):
    pv, op = np.sign(np.cos(CYCLE + 0.3)) + noise(28, 0.1), np.arcsin(np.sin(CYCLE)) + noise(29, 0.05)
    sp = 0.2 * np.sin(CYCLE / 3)
    here, there = rivals(pv, op, sp), rivals(flip * gain * pv + offset, op / gain - offset, flip * gain * sp + offset)
    for cause, rival in here.items():
        assert there[cause].strength == pytest.approx(rival.strength, abs=1e-6), cause


@pytest.mark.parametrize("probability", [0.1, 0.4, 0.6, 0.95])
def test_stiction_wins_from_one_half_on_and_ranks_by_its_probability_below(probability):
    pv, op = np.sign(np.cos(CYCLE + 0.3)) + noise(30, 0.1), np.arcsin(np.sin(CYCLE)) + noise(31, 0.05)
    record = UniformRecord(1.0, pv, op, None, np.zeros(N, bool))
    oscillation = detect(record)
    features = extract(record, oscillation)
    ranked = contest(compete(record, oscillation, features), probability, features)
    assert sum(rival.cause == "stiction" for rival in ranked) == 1
    won = winner(ranked)
    assert (won is not None and won.cause == "stiction") == (probability >= 0.5)
    if won is None:
        assert runner_up(ranked) is None


def test_stiction_tells_what_a_sticky_valve_explains_in_free_run():
    told = SimpleNamespace(named={"held_sticky": 0.62, "held_linear": -0.3}.get)
    assert contest((), 0.8, told)[0].text == (
        "probability 0.80; fitted on one half of each window and run freely on the other, a sticky valve explains 62 % "
        "of PV, a linear one 0 %"
    )


def shaken(
    period_s: float, valve: TwoParameterValve | None = None, sp: Signal | None = None, seed: int = 1
) -> dict[str, Rival]:
    """A flow under a PI controller and a noisy transmitter, swung by a sine from outside or by its valve."""
    spec = LoopSpec(
        plant=first_order(1.0, 10.0, 3.0),
        controller=Pid(0.8, 10.0),
        load=Signal(value=2.0) if valve else Signal(),
        upset=Signal() if valve or sp else Signal(waves=(Wave(3.0, period_s),), noise_sd=0.2, noise_tau_s=40.0),
        sp=sp or Signal(),
        noise=Signal(noise_sd=0.4),
        settle_s=300.0,
    )
    record = simulate_loop(spec if valve is None else replace(spec, valve=valve), float(N), 1.0, seed).uniform()
    return rivals(record.pv, record.op, record.sp)


@pytest.mark.parametrize("period_s", [40.0, 55.0, 70.0])
def test_a_sine_under_noise_counts_against_stiction_though_its_shape_is_lost(period_s: float):
    sines = shaken(period_s)["tuning_or_sinusoidal_disturbance"]
    assert sines.stands_out
    assert sines.counts > 0
    assert "one line of the spectrum" in sines.text


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_limit_cycle_under_the_same_noise_is_no_line(seed: int):
    sines = shaken(0.0, TwoParameterValve(6.0, 3.0), seed=seed)["tuning_or_sinusoidal_disturbance"]
    assert not sines.stands_out


def test_a_sine_of_the_set_point_is_not_taken_for_one_from_outside():
    found = shaken(0.0, sp=Signal(waves=(Wave(8.0, 55.0),)))
    assert "one line of the spectrum" not in found["tuning_or_sinusoidal_disturbance"].text


WAVES = 2 * np.pi * np.arange(15 * PER_CYCLE) / PER_CYCLE


@pytest.mark.parametrize(("wave", "third"), [(sawtooth(WAVES, 0.5), 1 / 9), (np.sign(np.sin(WAVES + 0.1)), 1 / 3)])
def test_the_third_harmonic_of_a_triangle_and_of_a_square(wave: np.ndarray, third: float):
    assert line(wave).third == pytest.approx(third, rel=0.02)
    assert line(wave).loudest > 100.0


def test_a_sine_is_one_line_and_noise_bounds_its_harmonics():
    clean, noisy = line(np.sin(WAVES)), line(np.sin(WAVES) + 0.3 * np.random.default_rng(4).normal(size=len(WAVES)))
    assert clean.share > 0.999
    assert clean.third < 1e-3
    assert 0.97 < noisy.share < clean.share
    assert clean.third < noisy.third < 0.1
    assert noisy.loudest < 4.0


def test_a_swing_that_changes_its_period_is_no_line():
    wandering = np.cumsum(0.15 * np.random.default_rng(7).normal(size=len(WAVES)))
    assert line(np.sin(WAVES + wandering)).share < 0.9


def test_few_cycles_have_no_line():
    assert line(np.sin(WAVES[: 9 * PER_CYCLE])) is None
    assert worst([line(np.sin(WAVES)), None]) is None


def test_of_several_lines_the_worst_is_told():
    assert worst([Line(0.99, 0.02, 4.0), Line(0.95, 0.01, 7.0)]) == Line(0.95, 0.02, 7.0)


def test_a_line_is_free_of_unit_and_sign():
    wave = np.sin(WAVES) + 0.2 * np.random.default_rng(5).normal(size=len(WAVES))
    one, other = line(wave), line(-40.0 * wave)
    assert (other.share, other.third, other.loudest) == pytest.approx((one.share, one.third, one.loudest))
