"""What flows over a weir, all that flows fouled, a scale that is bent: each by its name, not by what it looks like."""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.compete.competition import contenders, glance, survey
from app.engine.mismatch.fit.fitting import fit_linear
from app.engine.mismatch.fit.scan import ground, scan
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.loop.block import Block, Context
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics import fixed
from app.engine.mismatch.physics.gain_drift import flows_one_way
from app.engine.mismatch.physics.static_gain import rises
from app.engine.recording import FloatArray
from tests.engine.open_loop import moves, noise

N, HELD, SUBSTEPS = 1500, 60, 20
PLANT = Plant(1.5, 30.0, 4.0)
BENT, THIRD = -0.2, -0.5


def euler(op: FloatArray, head: float, exponent: float) -> FloatArray:
    """30 dx/dt = 1.5 u - head / n ((1 + x / head)^n - 1), 4 s late: straight steps of a twentieth of a second."""
    x, level = np.zeros(len(op)), 0.0
    for t in range(1, len(op)):
        drive = 1.5 * op[max(t - 5, 0)]
        for _ in range(SUBSTEPS):
            out = head / exponent * (max(1.0 + level / head, 0.0) ** exponent - 1.0)
            level += (drive - out) / (30.0 * SUBSTEPS)
        x[t] = level
    return x


def said_of(op: FloatArray, pv: FloatArray) -> Explanation:
    return explain(Comparison("loop", 1.0, 40.0 + op, 50.0 + pv, simulation=LinearSimulation(1.5, (30.0,), 4.0)))


@pytest.mark.parametrize("exponent", [0.5, 1.5, 2.5])
def test_a_level_falls_by_the_power_of_it_that_flows_out(exponent: float) -> None:
    op = moves(420, HELD)
    op = op - op[0]
    seen = run_process(op, Plant(1.5, 30.0, 4.0, head=16.0, exponent=exponent), 1.0)
    assert seen == pytest.approx(euler(op, 16.0, exponent), abs=0.15)


@pytest.mark.parametrize("exponent", [1.5, 2.5])
def test_what_flows_over_a_weir_is_an_outflow_law(exponent: float) -> None:
    op = moves(N, HELD)
    said = said_of(op, euler(op, 14.0, exponent) + noise(N))
    assert [effect.code for effect in said.effects] == ["process.outflow_law"]
    power = next(p for p in said.effects[0].parameters if p.name == "exponent")
    assert power.value == pytest.approx(exponent, rel=0.25)


@pytest.mark.parametrize("lasting", [1100.0, 1.0])
def test_all_that_flows_fouled_is_one_drift_of_its_gain(lasting: float) -> None:
    """Of OP at 40 % a fifth less of all that flows is 8 % less at the working point too."""
    op = moves(N, HELD)
    left = 1.0 - 0.2 * np.clip((np.arange(N) - 400.0) / lasting, 0.0, 1.0)
    said = said_of(op, run_process(left * (40.0 + op) - 40.0, PLANT, 1.0) + noise(N))
    assert [effect.code for effect in said.effects] == ["process.gain_drift"]
    told = {p.name: p.value for p in said.effects[0].parameters}
    assert told["change"] == pytest.approx(-0.2, abs=0.04)
    assert told["shift"] == pytest.approx(-8.0, abs=1.5)


def test_a_drift_of_all_that_flows_does_not_turn_its_sign() -> None:
    op = moves(420, HELD)
    context = Context(experiment(1.0, op, op), PLANT)
    far, within = 10.0 * float(np.ptp(op)), 0.0
    assert flows_one_way(np.array([100.0, -0.2, -0.2 * far]), context)
    assert not flows_one_way(np.array([100.0, -0.2, -0.2 * within]), context)
    assert not flows_one_way(np.array([100.0, 0.0, -2.0]), context)
    assert not flows_one_way(np.array([100.0, -0.01, -0.01 * far]), context)
    assert not flows_one_way(np.array([100.0, -0.1, -0.1 * 5.0 * far]), context)


def test_what_turns_the_sign_of_what_flows_stands_in_no_other_form_s_place() -> None:
    """A gain that drifts about what OP goes through in the record: that of all that flows would gain more in a scan."""
    op = moves(N, HELD)
    drifting = (1.0 + 0.6 * np.clip((np.arange(N) - 400.0) / 1100.0, 0.0, 1.0)) * (op - np.median(op))
    pv = run_process(drifting, PLANT, 1.0) + noise(N)
    base = fit_linear(experiment(1.0, op, pv), Given(PLANT))
    context = Context(base.record, base.plant)
    drifts = tuple(block for block in fixed() if block.code == "process.gain_drift")
    solved = [start.values for start in scan(named(drifts, "whole"), (ground(base, base.noise),))[0]]
    assert not flows_one_way(solved[0], context)
    for scanned in (*survey(base, drifts), *glance(base, drifts)):
        if scanned.block.form in ("whole", "whole-step"):
            assert all(scanned.block.sensible(start.values, context) for start in scanned.starts)
            assert not scanned.points[0] or flows_one_way(scanned.points[0][0].values, context)
    entered = contenders(base, drifts)
    assert entered[0].fit.parts[-1].makes_sense(context)


def named(blocks: tuple[Block, ...], form: str) -> Block:
    return next(block for block in blocks if block.form == form)


def test_a_bent_scale_of_pv_is_no_limit() -> None:
    op = moves(N, HELD)
    said = said_of(op, 9.0 * np.tanh(run_process(op, PLANT, 1.0) / 9.0) + noise(N))
    assert said.effects[0].code == "process.nonlinear_gain"
    assert "sensor.saturation" not in {effect.code for effect in said.effects}


def test_a_scale_that_turns_back_is_none() -> None:
    pv = np.linspace(-5.0, 5.0, 100)
    context = Context(experiment(1.0, pv, pv), PLANT)
    assert rises(np.array([BENT, THIRD]), context)
    assert not rises(np.array([BENT, 4.0 * THIRD]), context)
