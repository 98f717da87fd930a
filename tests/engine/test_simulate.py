"""The closed-loop simulator against what can be worked out by hand."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg, signal

from app.engine.recording import FloatArray
from app.engine.simulate import (
    LinearController,
    LinearValve,
    LoopSpec,
    Manual,
    OneParameterValve,
    PhysicalActuator,
    Pid,
    Plant,
    Signal,
    StuckValve,
    TwoParameterValve,
    Wave,
    first_order,
    integrator,
    second_order,
    simulate_loop,
)
from app.engine.valve import CLASSIC
from app.errors import DataError

PUSH = Signal(steps=((0.0, 1.0),))


def open_loop(plant: Plant, **changes: object) -> LoopSpec:
    return LoopSpec(plant, Manual(), load=PUSH, **changes)


def test_first_order_step_response_is_exact_at_any_step() -> None:
    loop = simulate_loop(open_loop(first_order(2.0, 30.0)), 300.0, 10.0)
    assert loop.pv == pytest.approx(2.0 * (1.0 - np.exp(-loop.time_s / 30.0)), abs=1e-11)


@given(theta=st.floats(0.0, 40.0), step=st.sampled_from([0.5, 1.0, 5.0]))
@settings(max_examples=30)
def test_dead_time_is_exact_between_steps_too(theta: float, step: float) -> None:
    loop = simulate_loop(open_loop(first_order(2.0, 30.0, theta), step_s=step), 200.0, 5.0)
    late = np.maximum(0.0, loop.time_s - theta)
    assert loop.pv == pytest.approx(2.0 * (1.0 - np.exp(-late / 30.0)), abs=1e-9)


def test_a_signal_steps_at_its_times_in_whatever_order_they_are_told() -> None:
    time_s, rng = np.arange(6) * 0.1, np.random.default_rng(0)
    steps = ((0.3, 2.0), (0.1, -1.0), (0.3, 0.5))
    assert Signal(4, steps).sample(time_s, rng).tolist() == [4.0, 3.0, 3.0, 5.5, 5.5, 5.5]
    assert Signal(4, noise_sd=0.1).sample(time_s, rng).std() > 0.0


@pytest.mark.parametrize(("order", "tau_s", "step_s"), [(3, 3600.0, 360.0), (4, 600.0, 60.0)])
def test_slow_lags_of_high_order_settle_where_they_must(order: int, tau_s: float, step_s: float) -> None:
    """Their discrete form has entries of very different size, and the least of them hold the gain."""
    plant = Plant((tau_s**-order,), tuple(np.poly((-1.0 / tau_s,) * order)))
    loop = simulate_loop(open_loop(plant), 400.0 * step_s, step_s)
    t = loop.time_s / tau_s
    rising = 1.0 - np.exp(-t) * sum(t**k / math.factorial(k) for k in range(order))
    assert loop.pv == pytest.approx(rising, abs=1e-9)


@pytest.mark.parametrize("size", [1e-60, 1.0, 1e60])
def test_noise_of_any_size_is_the_same_noise(size: float) -> None:
    times = np.arange(50.0)
    unit, other = (Signal(noise_sd=sd, noise_tau_s=4.0).sample(times, np.random.default_rng(1)) for sd in (1.0, size))
    assert other / size == pytest.approx(unit, rel=1e-6)


def test_second_order_step_response_matches_scipy() -> None:
    loop = simulate_loop(open_loop(second_order(1.5, 20.0, 0.3)), 300.0, 5.0)
    _, expected = signal.step(([1.5], [400.0, 12.0, 1.0]), T=loop.time_s)
    assert loop.pv == pytest.approx(expected, abs=1e-6)


def test_integrator_ramps_with_its_gain_after_the_dead_time() -> None:
    loop = simulate_loop(open_loop(integrator(0.02, 7.0)), 100.0, 5.0)
    assert loop.pv == pytest.approx(0.02 * np.maximum(0.0, loop.time_s - 7.0), abs=1e-11)
    assert loop.spec.plant.integrating


def test_the_gain_of_a_plant_is_that_of_its_zeros_over_that_of_its_poles() -> None:
    assert Plant((4.0, 8.0), (1.0, 4.0, 3.0)).gain == pytest.approx(4.0 * 2.0 / (1.0 * 3.0))


@pytest.mark.parametrize(
    ("controller", "offset"),
    [(Pid(0.8, 40.0), 0.0), (Pid(0.8, 40.0, 4.0), 0.0), (Pid(0.8), 5.0 / (1.0 + 0.8 * 2.0))],
    ids=["PI", "PID", "P"],
)
def test_steady_state_is_where_it_must_be(controller: Pid, offset: float) -> None:
    spec = LoopSpec(
        first_order(2.0, 30.0, 3.0),
        controller,
        sp=Signal(steps=((50.0, 5.0),)),
        pv_start=20.0,
        op_start=40.0,
        step_s=0.5,
    )
    loop = simulate_loop(spec, 3000.0, 5.0)
    assert loop.pv[0] == 20.0
    assert loop.op[0] == 40.0
    assert loop.pv[-1] == pytest.approx(25.0 - offset, abs=1e-6)
    assert loop.op[-1] == pytest.approx(40.0 + (5.0 - offset) / 2.0, abs=1e-6)


def test_closed_loop_follows_the_continuous_one_at_a_fine_step() -> None:
    spec = LoopSpec(first_order(2.0, 30.0), Pid(0.8, 40.0), sp=PUSH, step_s=0.02)
    loop = simulate_loop(spec, 200.0, 2.0)
    # Kc (Ti s + 1) K over Ti s (tau s + 1) + Kc (Ti s + 1) K
    _, expected = signal.step(([0.8 * 2 * 40, 0.8 * 2], [40 * 30, 40 + 0.8 * 2 * 40, 0.8 * 2]), T=loop.time_s)
    assert loop.pv == pytest.approx(expected, abs=2e-3)


def test_pi_written_as_transfer_function_is_the_same_controller() -> None:
    plain = LoopSpec(Plant((10.0,), (1.0, 8.0)), Pid(0.1, 1.0), sp=PUSH, step_s=0.01)
    written = replace(plain, controller=LinearController((0.1, 0.1), (1.0, 0.0)))
    assert simulate_loop(written, 20.0, 0.1).pv == pytest.approx(simulate_loop(plain, 20.0, 0.1).pv, abs=1e-12)


def noisy(valve: object, plant: Plant | None = None) -> LoopSpec:
    return LoopSpec(
        plant or first_order(1.5, 20.0, 4.0),
        Pid(0.6, 25.0),
        valve,
        load=Signal(value=3.0, noise_sd=1.0, noise_tau_s=60.0),
        noise=Signal(noise_sd=0.2),
        step_s=1.0,
    )


@given(
    seed=st.integers(0, 1000),
    algorithm=st.sampled_from(["he", "choudhury", "kano", "one"]),
    tau=st.floats(5.0, 100.0),
    theta=st.floats(0.0, 10.0),
)
@settings(max_examples=25)
def test_valve_without_stiction_is_the_linear_loop(seed: int, algorithm: str, tau: float, theta: float) -> None:
    plant = first_order(1.5, tau, theta)
    valve = OneParameterValve(0.0) if algorithm == "one" else TwoParameterValve(0.0, 0.0, algorithm)
    linear = simulate_loop(noisy(LinearValve(), plant), 500.0, 5.0, seed)
    sticky = simulate_loop(noisy(valve, plant), 500.0, 5.0, seed)
    assert sticky.pv == pytest.approx(linear.pv, abs=1e-9)
    assert np.array_equal(linear.v, linear.op)


@given(seed=st.integers(0, 1000), unit=st.floats(1e-3, 1e3))
@settings(max_examples=20)
def test_unit_of_pv_changes_pv_alone(seed: int, unit: float) -> None:
    spec = noisy(TwoParameterValve(5.0, 2.0))
    other = replace(
        spec,
        plant=first_order(1.5 * unit, 20.0, 4.0),
        controller=Pid(0.6 / unit, 25.0),
        noise=Signal(noise_sd=0.2 * unit),
    )
    one, two = simulate_loop(spec, 300.0, 5.0, seed), simulate_loop(other, 300.0, 5.0, seed)
    assert two.pv == pytest.approx(unit * one.pv, rel=1e-6, abs=1e-6 * unit)
    assert two.op == pytest.approx(one.op, rel=1e-6, abs=1e-6)


def test_same_seed_same_record_other_seed_another() -> None:
    spec = noisy(TwoParameterValve(5.0, 2.0))
    assert np.array_equal(simulate_loop(spec, 500.0, 5.0, 7).pv, simulate_loop(spec, 500.0, 5.0, 7).pv)
    assert not np.array_equal(simulate_loop(spec, 500.0, 5.0, 7).pv, simulate_loop(spec, 500.0, 5.0, 8).pv)


@pytest.mark.parametrize("seed", range(4))
def test_the_last_bits_of_the_machine_s_libraries_make_no_other_loop(seed: int, monkeypatch) -> None:
    """A sticky valve under noise turns them into another moment at which it slips, and then all is another."""
    load = Signal(noise_sd=0.4, noise_tau_s=40.0, waves=(Wave(0.3, 170.0),))
    spec = replace(noisy(TwoParameterValve(4.0, 2.0), second_order(1.0, 9.0, 1.2, 3.5)), load=load)
    here = simulate_loop(spec, 4000.0, 1.0, seed)
    for module, name in ((linalg, "expm"), (signal, "lfilter"), (np, "sin")):
        monkeypatch.setattr(module, name, nudged(getattr(module, name)))
    elsewhere = simulate_loop(spec, 4000.0, 1.0, seed)
    assert np.array_equal(here.pv, elsewhere.pv)
    assert np.array_equal(here.op, elsewhere.op)


def nudged(function: Callable[..., FloatArray]) -> Callable[..., FloatArray]:
    """The same function on a machine where the last bit of its answers is another."""
    return lambda *given: np.nextafter(function(*given), np.inf)


@pytest.mark.parametrize(
    "valve",
    [
        TwoParameterValve(6.0, 3.0),
        TwoParameterValve(6.0, 3.0, "choudhury"),
        TwoParameterValve(6.0, 3.0, "kano"),
        OneParameterValve(4.0),
        PhysicalActuator(CLASSIC, op_per_pct=0.15),
    ],
    ids=["he", "choudhury", "kano", "one", "physical"],
)
def test_stiction_and_integral_action_oscillate_without_end(valve: object) -> None:
    spec = LoopSpec(
        first_order(1.5, 20.0, 4.0), Pid(0.6, 15.0), valve, load=Signal(value=4.0), step_s=1.0, settle_s=5000.0
    )
    loop = simulate_loop(spec, 4000.0, 5.0)
    halves = np.ptp(loop.pv[:400]), np.ptp(loop.pv[400:])
    assert min(halves) > 1.0
    assert halves[0] == pytest.approx(halves[1], rel=0.1)
    assert np.std(simulate_loop(replace(spec, valve=LinearValve()), 4000.0, 5.0).pv) < 1e-6


def test_limit_cycle_of_pure_deadband_needs_an_integrating_plant() -> None:
    backlash = TwoParameterValve(4.0, 0.0)
    self_regulating = LoopSpec(
        first_order(1.0, 20.0, 2.0), Pid(0.5, 20.0), backlash, load=Signal(value=5.0), step_s=1.0
    )
    level = replace(self_regulating, plant=integrator(0.02, 2.0), controller=Pid(2.0, 60.0))
    assert np.ptp(simulate_loop(replace(self_regulating, settle_s=2e4), 2000.0, 5.0).pv) < 0.01
    assert np.ptp(simulate_loop(replace(level, settle_s=2e4), 2000.0, 5.0).pv) > 0.5


def test_op_stays_within_its_limits_and_the_integral_does_not_wind_up() -> None:
    sp = Signal(steps=((10.0, 60.0), (1000.0, -50.0)))
    spec = LoopSpec(first_order(1.0, 30.0), Pid(2.0, 20.0), sp=sp, op_start=50.0, op_limits=(0.0, 100.0), step_s=1.0)
    held = simulate_loop(spec, 2000.0, 5.0)
    wound = simulate_loop(replace(spec, controller=Pid(2.0, 20.0, tracking_s=1e9)), 2000.0, 5.0)
    assert held.op.max() == 100.0
    assert held.op.min() >= 0.0
    after = held.time_s > 1000.0
    assert np.abs(held.pv - held.sp)[after].sum() < 0.2 * np.abs(wound.pv - wound.sp)[after].sum()


def test_manual_stuck_and_dead_transmitter_do_what_their_names_say() -> None:
    spec = noisy(LinearValve())
    manual = simulate_loop(replace(spec, controller=Manual(), op_start=33.0), 500.0, 5.0)
    assert np.all(manual.op == 33.0)
    assert not manual.recording("x").automatic.any()
    stuck = simulate_loop(replace(spec, valve=StuckValve(), op_start=33.0), 500.0, 5.0)
    assert np.all(stuck.v == 33.0)
    assert np.ptp(stuck.op) > 0.0
    dead = simulate_loop(replace(spec, transmitter_frozen_from_s=100.0), 500.0, 5.0)
    assert np.ptp(dead.pv[:20]) > 0.0
    assert np.ptp(dead.pv[20:]) == 0.0


def test_limits_on_one_side_are_no_span() -> None:
    spec = replace(noisy(LinearValve()), op_limits=(-np.inf, 100.0), pv_limits=(0.0, np.inf))
    made = simulate_loop(spec, 500.0, 5.0).recording("loop")
    assert (made.op_range, made.pv_range) == (None, None)
    made = simulate_loop(replace(spec, op_limits=(-50.0, 100.0)), 500.0, 5.0).recording("loop")
    assert made.op_range == (-50.0, 100.0)


def test_quantisation_and_transmitter_limits() -> None:
    loop = simulate_loop(
        replace(noisy(LinearValve()), pv_resolution=0.5, op_resolution=0.25, pv_limits=(-2.0, 2.0)), 500.0, 5.0
    )
    assert np.all(np.mod(loop.pv, 0.5) == 0.0)
    assert np.all(np.mod(loop.op, 0.25) == 0.0)
    assert np.abs(loop.pv).max() <= 2.0


def test_record_has_the_samples_asked_for_and_its_times_count_from_its_start() -> None:
    spec = LoopSpec(first_order(1.0, 10.0), Pid(0.5, 10.0), sp=Signal(steps=((60.0, 2.0),)), step_s=0.1, settle_s=33.0)
    loop = simulate_loop(spec, 100.0, 5.0)
    assert loop.time_s.tolist() == [5.0 * k for k in range(20)]
    assert loop.sp.tolist() == [0.0] * 12 + [2.0] * 8
    assert loop.recording("a").samples == loop.uniform().samples == 20


def test_coarser_sampling_of_the_same_scan_is_a_thinned_record() -> None:
    spec = replace(noisy(TwoParameterValve(5.0, 2.0)), settle_s=60.0)
    fine, coarse = simulate_loop(spec, 600.0, 1.0, 3), simulate_loop(spec, 600.0, 6.0, 3)
    assert np.array_equal(fine.pv[::6], coarse.pv)


def test_coloured_noise_has_the_spread_and_memory_asked_for() -> None:
    time_s = np.arange(200_000) * 2.0
    noise = Signal(noise_sd=3.0, noise_tau_s=20.0).sample(time_s, np.random.default_rng(0))
    assert np.std(noise) == pytest.approx(3.0, rel=0.05)
    lag = np.corrcoef(noise[:-10], noise[10:])[0, 1]
    assert lag == pytest.approx(np.exp(-1.0), abs=0.03)


@pytest.mark.parametrize(
    ("form", "expected"),
    [("sine", [0, 2, 0, -2]), ("square", [2, 2, -2, -2]), ("triangle", [0, 2, 0, -2])],
)
def test_waves(form: str, expected: list[float]) -> None:
    wave = Signal(value=1.0, waves=(Wave(2.0, 8.0, form),))
    assert wave.sample(np.arange(0.0, 8.0, 2.0), np.random.default_rng(0)) - 1.0 == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("make", "code"),
    [
        (lambda: Plant((1.0, 0.0), (1.0, 1.0)), "plant_improper"),
        (lambda: first_order(1.0, 5.0, -1.0), "dead_time_negative"),
        (lambda: simulate_loop(noisy(LinearValve()), 10.0, 2.5), "simulation_step"),
        (lambda: simulate_loop(noisy(LinearValve()), 5.0, 5.0), "simulation_too_short"),
        (lambda: simulate_loop(noisy(OneParameterValve(-1.0)), 50.0, 5.0), "stiction_band"),
        (lambda: simulate_loop(replace(noisy(LinearValve()), controller=Pid(1.0, 0.0)), 50.0, 5.0), "integral_time"),
        (
            lambda: simulate_loop(replace(noisy(LinearValve()), controller=Pid(-50.0, 0.1)), 9000.0, 5.0),
            "simulation_unstable",
        ),
    ],
)
def test_what_cannot_be_simulated_is_refused_with_a_code(make: object, code: str) -> None:
    with pytest.raises(DataError) as refused:
        make()
    assert refused.value.code == code
