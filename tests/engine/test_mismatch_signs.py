"""A record upside down, or in other units, is explained as it was: what is the same physics then is found as well."""

from functools import cache

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.experiment import Experiment, experiment, span
from app.engine.mismatch.fitting import Fit, descend, finish, fit_linear, polish, quiet_noise, slopes
from app.engine.mismatch.fitting import residual_rows as rows_at
from app.engine.mismatch.given import behind_trace
from app.engine.mismatch.physics import by_name
from app.engine.mismatch.scan import ground, scan, task_with
from app.engine.mismatch.task import Task, start_at
from app.engine.recording import FloatArray
from tests.engine.plain_loop import GIVEN, TS, moves, recorded

LIMIT = 2.0  # OP as deviation
OVERFLOW, EMPTY = "process.overflow/high", "process.overflow/low"
KEPT, PV_DOWN, OP_DOWN, OTHER_UNIT = ((1.0, 0.0), 1.0), ((-1.0, 0.0), 1.0), ((1.0, 0.0), -1.0), ((-0.037, 273.15), -1.8)


@cache
def limited() -> FloatArray:
    return recorded(np.minimum(moves(), LIMIT))


@cache
def asked(pv_in: tuple[float, float], op_in: float) -> Explanation:
    scale, offset = pv_in
    simulation = LinearSimulation(GIVEN.gain * scale / op_in, GIVEN.time_constants_s, GIVEN.dead_time_s)
    return explain(Comparison("F1", TS, op_in * (40.0 + moves()), scale * limited() + offset, simulation=simulation))


@pytest.mark.parametrize(("pv_in", "op_in"), [PV_DOWN, OP_DOWN, OTHER_UNIT])
def test_sign_and_unit_change_no_name(pv_in: tuple[float, float], op_in: float) -> None:
    upright, other = asked(*KEPT), asked(pv_in, op_in)
    assert [(e.code, e.alternatives) for e in other.effects] == [(e.code, e.alternatives) for e in upright.effects]
    assert [e.gain for e in other.effects] == pytest.approx([e.gain for e in upright.effects], rel=1e-3)
    assert upright.effects[0].code == "valve.saturation"
    assert other.effects[0].parameters[0].value == pytest.approx(op_in * (40.0 + LIMIT), rel=0.01)
    assert other.fit.explained.rmse == pytest.approx(abs(pv_in[0]) * upright.fit.explained.rmse, rel=1e-3)


def linear(sign: float) -> Fit:
    record = recorded_as(sign)
    given = behind_trace(record, sign * limited()).given
    return fit_linear(record, given, rounds=1)


def recorded_as(sign: float) -> Experiment:
    return experiment(TS, 40.0 + moves(), sign * limited())


def begun(found: Fit, name: str, level: float) -> tuple[Task, FloatArray]:
    task = task_with(found, by_name(found.record)[name])
    return task, start_at(task, found.plant, np.array([level]))


def upright_and_upside_down(share: float) -> tuple[tuple[Task, FloatArray], tuple[Task, FloatArray]]:
    level = float(np.quantile(recorded_as(1.0).pv_deviation, share))
    return begun(linear(1.0), OVERFLOW, level), begun(linear(-1.0), EMPTY, -level)


@pytest.mark.parametrize("share", [0.5, 0.75, 0.98])
def test_a_search_ends_at_the_same_limit_upside_down(share: float) -> None:
    ends = []
    for task, x in upright_and_upside_down(share):
        noise = quiet_noise(task.record, task.given)
        ends.append(task.parts_at(polish(task, x, noise))[0].values[0])
        ends.append(task.parts_at(descend(task, x, noise, 6))[0].values[0])
    assert ends[2:] == pytest.approx([-end for end in ends[:2]], rel=1e-6)


def test_slopes_are_the_same_upside_down() -> None:
    found = []
    for task, x in upright_and_upside_down(0.75):
        noise = quiet_noise(task.record, task.given)
        found.append(slopes(task, x, noise, rows_at(task, x, noise), [len(x) - 1]))
    assert found[1] == pytest.approx(found[0], rel=1e-6, abs=1e-9)


def test_a_load_that_goes_down_is_looked_for_behind_friction_as_one_that_goes_up() -> None:
    """Friction lets go to one side only: what a load does upwards says nothing of what it does downwards."""
    ends = []
    for sign in (1.0, -1.0):
        found = linear(sign)
        blocks = by_name(found.record)
        task = task_with(found, blocks["process.friction/before-the-lag"])
        noise = quiet_noise(found.record, found.given)
        rubbing = finish(task, start_at(task, found.plant, np.array([2.0, 1.0])), noise)
        best = scan(blocks["disturbance.step"], (ground(rubbing, noise),))[0][0]
        ends.append((best.values[0], sign * best.values[1], best.gain))
    assert ends[1] == pytest.approx(ends[0], rel=1e-6)


def test_a_span_is_that_of_the_signal_upside_down_to_the_last_bit() -> None:
    for seed in range(20):
        signal = np.random.default_rng(seed).normal(size=777)
        assert span(-signal) == span(signal)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_model_behind_a_trace_hangs_on_no_unit(unit: float) -> None:
    plain, other = behind_trace(recorded_as(1.0), limited()), behind_trace(recorded_as(unit), unit * limited())
    assert other.given.plant.K / unit == pytest.approx(plain.given.plant.K, rel=1e-3)
    for name in ("tau", "tau2", "theta"):
        assert getattr(other.given.plant, name) == pytest.approx(getattr(plain.given.plant, name), rel=1e-3)
