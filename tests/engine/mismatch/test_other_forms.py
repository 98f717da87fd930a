"""Effects in other forms than a ramp, a step and a lag: what comes and goes, levels out, or is felt in passing."""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, lag
from app.engine.mismatch.physics import by_name, coupling
from app.engine.recording import FloatArray

N, LONG, TAU, LATE = 1500, 2400, 30.0, 4
TIME = np.arange(LONG, dtype=np.float64)
NOTHING, ALWAYS = np.zeros(LONG), np.ones(LONG)


def loop(
    seed: int,
    *,
    sensor: FloatArray = NOTHING,
    gain: FloatArray = ALWAYS,
    loaded: FloatArray = NOTHING,
    later: FloatArray = NOTHING,
    further: int = 0,
    low: float = -99.0,
    still: int = 0,
    calm: float = 1.0,
    samples: int = N,
) -> Comparison:
    """A PI loop at 1 s: a gain of 1.5 (times `gain`), 30 s of lag, 4 s of dead time (and `later`). sensor: added to
    what is measured; loaded: to what enters the process. further: lags of 5 s more. low: a stop of the valve, with
    another at 3.
    """
    rng = np.random.default_rng(seed)
    sp = np.repeat(rng.uniform(-6.0, 6.0, samples // 150), 150)
    sp[:still] = 0.0
    sp[:150] = 0.0
    op, pv, states, summed, load = np.zeros(samples), np.zeros(samples), [0.0] * (1 + further), 0.0, 0.0
    for t in range(samples):
        pv[t] = states[-1] + sensor[t] + 0.1 * rng.standard_normal()
        summed += 0.8 * (sp[t] - pv[t]) / 30.0
        op[t] = 0.8 * (sp[t] - pv[t]) + summed
        load = 0.97 * load + 0.3 * calm * np.sqrt(1.0 - 0.97**2) * rng.standard_normal()
        stem = op[max(t - LATE - round(later[t]), 0)]
        stem = stem if low < -90.0 else min(max(stem, low), 3.0)
        drive = 1.5 * gain[t] * stem + load + loaded[t]
        for k, tau in enumerate((TAU, *(5.0,) * further)):
            states[k] += (1.0 - np.exp(-1.0 / tau)) * (drive - states[k])
            drive = states[k]
    return Comparison("form", 1.0, 40.0 + op, 50.0 + pv, 50.0 + sp, simulation=LinearSimulation(1.55, (28.8,), 4.0))


def during(begin_s: float, end_s: float) -> FloatArray:
    return ((begin_s <= TIME) & (end_s > TIME)).astype(np.float64)


def first(said: Explanation) -> set[str]:
    return {said.effects[0].code, *said.effects[0].alternatives} if said.effects else set()


def test_a_sensor_that_drifts_until_it_is_set_right_is_named() -> None:
    said = explain(loop(1, sensor=2.5 * (TIME - 470.0) / 600.0 * ((TIME >= 470.0) & (TIME < 1070.0))))
    assert said.effects[0].code == "sensor.drift"
    window = said.effects[0].windows[0]
    assert window.start_s == pytest.approx(470.0, abs=130.0)
    assert window.end_s == pytest.approx(1070.0, abs=5.0)


def test_a_sensor_whose_drift_levels_out_is_no_step_of_the_load() -> None:
    said = explain(loop(3, sensor=-3.0 * -np.expm1(-np.maximum(TIME - 530.0, 0.0) / 170.0)))
    assert said.effects[0].code in {"sensor.drift", "disturbance.ramp"}


@pytest.mark.parametrize("change", [-0.4, 0.5])
def test_a_gain_that_is_another_for_a_while_has_drifted(change: float) -> None:
    said = explain(loop(4, gain=1.0 + change * during(530.0, 1000.0)))
    assert "process.gain_drift" in first(said)


def test_a_load_that_comes_and_goes_is_a_ramp_that_returns() -> None:
    said = explain(loop(7, loaded=3.0 * np.interp(TIME, [600.0, 1000.0, 1500.0], [0.0, 1.0, 0.0]), samples=LONG))
    assert said.effects[0].code == "disturbance.ramp"
    assert {one.name: one.value for one in said.effects[0].parameters} == {
        "start": pytest.approx(600.0, abs=100.0),
        "end": pytest.approx(1500.0, abs=100.0),
        "turn": pytest.approx(1000.0, abs=100.0),
        "size": pytest.approx(3.0, rel=0.3),
    }


def test_a_dead_time_that_becomes_longer_is_named_and_dated() -> None:
    said = explain(loop(8, later=12.0 * (TIME >= 700.0)))
    assert [effect.code for effect in said.effects] == ["process.dead_time"]
    start, extra = said.effects[0].parameters
    assert (start.value, extra.value) == (pytest.approx(700.0, abs=20.0), pytest.approx(12.0, rel=0.1))


def test_a_dead_time_that_was_never_another_does_not_set_in_where_the_loop_first_moves() -> None:
    said = explain(loop(11, later=8.0 * ALWAYS, still=800, calm=0.1))
    assert [effect.code for effect in said.effects] == ["process.dead_time"]
    assert [one.name for one in said.effects[0].parameters] == ["extra"]


def test_a_dead_time_that_grows_is_named() -> None:
    said = explain(loop(9, later=12.0 * TIME / N))
    assert [effect.code for effect in said.effects] == ["process.dead_time"]
    (extra,) = said.effects[0].parameters
    assert extra.value == pytest.approx(12.0, rel=0.15)


def test_a_valve_between_two_stops_is_limited_by_both() -> None:
    said = explain(loop(5, low=-2.0))
    assert said.effects[0].code == "valve.saturation"
    assert {"high", "low"} <= {parameter.name for parameter in said.effects[0].parameters}


def test_a_signal_that_is_felt_in_passing_is_coupled() -> None:
    cause = np.repeat(np.random.default_rng(6).uniform(-4.0, 4.0, LONG // 200), 200)
    arriving = lag(cause, 8.0, 1.0)
    plain = loop(6, sensor=arriving - lag(arriving, 60.0, 1.0), samples=LONG)
    said = explain(
        Comparison(
            "form", 1.0, plain.op, plain.pv, plain.sp, simulation=plain.simulation, measured=(("feed", 20.0 + cause),)
        )
    )
    assert said.effects[0].code == "disturbance.coupling"
    washout = next(p.value for p in said.effects[0].parameters if p.name == "washout")
    assert washout == pytest.approx(60.0, rel=0.3)


def test_the_forms_of_one_signal_take_no_name_of_another() -> None:
    cause = np.random.default_rng(9).normal(size=LONG)
    measured = (("feed", cause), ("feed, passing", np.roll(cause, 700)), ("feed, entering", np.roll(cause, 300)))
    record = experiment(1.0, 40.0 + np.sin(TIME / 50.0), 50.0 + np.sin(TIME / 50.0), measured=measured)
    names = [block.name for block in coupling.blocks(record)]
    assert len(names) == len(set(names)) == 9


def test_lags_in_a_row_are_no_sure_inverse_response() -> None:
    said = explain(loop(7, further=3))
    assert first(said) & {"process.extra_lag", "sensor.lag"}


def test_a_drift_that_is_set_right_ends_where_it_ends() -> None:
    record = experiment(1.0, 40.0 + np.sin(TIME / 50.0), 50.0 + np.sin(TIME / 50.0))
    block = by_name(record)["sensor.drift/recalibrated"]
    assert block.apply is not None
    added = block.apply(
        np.zeros(LONG), np.array([500.0, 900.0, 2.0]), Context(record, Plant(K=1.0, tau=10.0, theta=1.0))
    )
    assert added[:501] == pytest.approx(0.0)
    assert added[700] == pytest.approx(1.0, abs=0.02)
    assert added[902:] == pytest.approx(0.0)


def test_a_sensor_that_is_off_for_a_while_is_off_from_jump_to_jump() -> None:
    said = explain(loop(8, sensor=1.6 * during(447.0, 805.0)))
    assert [effect.code for effect in said.effects] == ["sensor.step"]
    window = said.effects[0].windows[0]
    assert (window.start_s, window.end_s) == pytest.approx((447.0, 805.0), abs=3.0)
