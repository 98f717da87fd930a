"""Neither the unit of a signal, nor its sign, nor how seldom it moves, decides what is looked for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.compare.comparison import record_of
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.fit.fitting import quiet_noise
from app.engine.mismatch.fit.given import Structure, Target, fit_structure
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.judge.validation import beginning, started
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.experiment import experiment, span
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics import coupling, library, two_tanks, valve_slew_limit
from app.engine.recording import FloatArray
from app.engine.valve import two_parameter_he

TS, HOUR = 1.0, 3600
PLANT = Plant(K=1.4, tau=60.0, theta=6.0)


def pulse(*heights: float) -> FloatArray:
    """OP up for 30 s in an hour, in so many pulses of equal length."""
    at, length = np.arange(HOUR), 30 // len(heights)
    begins = [(1 + k) * HOUR // (len(heights) + 1) for k in range(len(heights))]
    return 40.0 + sum(high * ((at >= t) & (at < t + length)) for t, high in zip(begins, heights, strict=True))


def answered(op: FloatArray) -> FloatArray:
    return 50.0 + run_process(op - 40.0, PLANT, TS) + 0.02 * np.random.default_rng(4).normal(size=len(op))


def test_the_span_of_a_signal_that_moves_seldom_is_its_range() -> None:
    assert span(pulse(10.0)) == 10.0
    assert span(np.linspace(0.0, 1.0, 1001)) == pytest.approx(0.98)
    outlier = np.where(np.arange(1001) == 500, 80.0, np.linspace(0.0, 1.0, 1001))
    assert span(outlier) == pytest.approx(0.98, abs=0.01)
    assert 0.0 < span(np.full(100, 3.0)) < 1e-50


def test_a_pulse_is_looked_at_in_its_own_size() -> None:
    record = experiment(TS, pulse(10.0), answered(pulse(10.0)))
    context = Context(record, PLANT)
    sizes = {
        name: block.starts(context, record.pv_deviation)[:, 0]
        for name in ("valve.deadband", "valve.stiction/he")
        for block in library(record)
        if block.name == name
    }
    assert sizes.keys() == {"valve.deadband", "valve.stiction/he"}
    assert all(0.05 < starts.min() < starts.max() < 15.0 for starts in sizes.values())


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_backlash_in_a_pulse_test_is_named() -> None:
    op = pulse(10.0, -6.0, 8.0)
    stem = two_parameter_he(op, np.array([3.0]), np.zeros(1), np.array([40.0]))[0]
    said = explain(Comparison("pulses", TS, op, answered(stem), simulation=LinearSimulation(1.4, (60.0,), 6.0)))
    assert len(said.effects) == 1
    assert "valve.deadband" in (said.effects[0].code, *said.effects[0].alternatives)
    band = said.effects[0].parameters[0]
    assert 2.0 < band.low < 3.0 < band.value < 4.0


@pytest.mark.parametrize("unit", [1e-14, 1e14])
def test_floors_follow_the_unit(unit: float) -> None:
    op, pv = pulse(10.0), answered(pulse(10.0))
    aux = np.random.default_rng(5).normal(size=HOUR)
    record = experiment(TS, op, pv, measured=(("AUX", aux),))
    other = experiment(TS, unit * op, unit * pv, measured=(("AUX", unit * aux),))
    given = Given(PLANT)
    assert quiet_noise(other, given).deviation == pytest.approx(unit * quiet_noise(record, given).deviation)
    assert [block.form for block in coupling.blocks(other)] == ["AUX", "AUX, passing", "AUX, entering"]
    still = [replace(r, op=np.full(HOUR, r.op_mid)) for r in (record, other)]
    one, two = (valve_slew_limit.rates(Context(r, PLANT)) for r in still)
    assert np.all(one > 0.0)
    assert two == pytest.approx(unit * one, rel=1e-6)


@pytest.mark.parametrize("second_order", [False, True])
def test_the_linear_loop_behind_pv_hangs_on_no_unit(second_order: bool) -> None:
    """In m3/s the search ended where it began: its gradients are the squares of PV's unit."""
    structure = Structure(second_order, False)

    def found(unit: float) -> Plant:
        record = experiment(TS, pulse(10.0, -6.0, 8.0), unit * answered(pulse(10.0, -6.0, 8.0)))
        plant = fit_structure(record, Target(record.pv, record.usable), structure).given.plant
        return plant.changed(K=plant.K / unit)

    assert found(1.0).tau == pytest.approx(PLANT.tau, rel=0.1)
    assert found(2.0**-20) == found(2.0**-50) == found(1.0)


def test_where_a_second_record_began_hangs_on_no_unit() -> None:
    """Steps and tolerances of the search are no smaller than 1e-8, whatever the unit."""

    def begun(unit: float) -> FloatArray:
        record = experiment(TS, pulse(10.0), unit * answered(pulse(10.0)))
        return started(record, beginning(record.usable), PLANT.changed(K=unit * PLANT.K), ()) / unit

    assert np.array_equal(begun(2.0**-30), begun(1.0))


def test_what_is_constant_but_for_rounding_moves_nothing() -> None:
    rounded = 1e9 / 3.0 + np.where(np.arange(HOUR) % 2, 6e-8, 0.0)
    assert np.std(rounded) > 1e-12
    record = experiment(TS, pulse(10.0), answered(pulse(10.0)), measured=(("AUX", rounded), ("ZERO", np.zeros(HOUR))))
    assert coupling.blocks(record) == ()


def test_two_tanks_hold_the_gain_in_what_op_drives_alone() -> None:
    op = 40.0 + np.repeat(np.random.default_rng(1).uniform(-6.0, 6.0, HOUR // 60), 60)
    one, other = experiment(TS, op, answered(op)), experiment(TS, -op, answered(op))
    plant = PLANT.changed(tau2=20.0)
    turned = plant.changed(K=-plant.K)
    values = np.array([9.0, 12.0, 0.2, 0.2, 0.0, 4.0, 0.5, 8.0])
    runs = [two_tanks.run(r.op_deviation, p, values, Context(r, p)) for r, p in ((one, plant), (other, turned))]
    assert np.array_equal(*runs)
    assert two_tanks.two_lags(Context(one, plant))
    assert two_tanks.two_lags(Context(other, turned))


def test_tanks_under_a_pump_that_counts_down_get_the_same_name(shared_dir: Path) -> None:
    path = shared_dir / "nonlinear" / "cascaded_tanks.csv"
    if not path.is_file():
        pytest.skip("no laboratory records here")
    rows = np.genfromtxt(path, delimiter=",", names=True)
    comparison = Comparison("tanks", 4.0, rows["uEst"], rows["yEst"])
    assert record_of(comparison).samples > 1000
    one, other = (explain(c) for c in (comparison, replace(comparison, op=-comparison.op)))
    assert names(other) == names(one) == ["sensor.saturation", "process.outflow_law", "process.overflow"]


def names(said: Explanation) -> list[str]:
    return [effect.code for effect in said.effects]


def test_a_simulation_in_another_unit_is_no_gain_that_a_load_hides() -> None:
    """PV over a trace in another unit, by least squares, is half the gain where OP works against a load."""
    rng = np.random.default_rng(0)
    sp, load = np.repeat(rng.uniform(-5.0, 5.0, 12), 200), 3.0 * lfilter([0.243], [1.0, -0.97], rng.normal(size=2400))
    op, pv = controlled(sp, load, 0.1 * rng.normal(size=2400))
    trace = run_process(op, LOADED, TS)
    given = [prepare(Comparison("unit", TS, op, pv, sp, trace=unit * trace)) for unit in (1.0, 100.0)]
    assert given[0].off == ()
    assert [reason.code for reason in given[1].off] == ["parameters_off"]
    assert given[1].share == pytest.approx(0.01, rel=0.15)
    assert pytest.approx(given[0].base.plant.K, rel=0.15) == given[1].base.plant.K


LOADED = Plant(K=1.0, tau=15.0, theta=3.0)


def controlled(sp: FloatArray, load: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """OP and PV (N,) of a PI loop around LOADED, a load (N,) beside OP."""
    op, pv, stay, integral = np.zeros(len(sp)), np.zeros(len(sp)), np.exp(-TS / LOADED.tau), 0.0
    level = 0.0
    for t in range(len(sp)):
        pv[t] = level + noise[t]
        error = sp[t] - pv[t]
        integral += error / 15.0
        op[t] = error + integral
        level = stay * level + (1.0 - stay) * ((op[t - 3] if t >= 3 else 0.0) + load[t])
    return op, pv
