"""Sticking valves in limit cycles at a constant set point; no name is listed which a better one contradicts."""

from dataclasses import replace

import numpy as np

from app.engine.mismatch import Comparison, LinearSimulation, explain
from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.naming import Believed
from app.engine.mismatch.compete.selection import LEAST_MARGIN, Selection, stands
from app.engine.mismatch.fit.fitting import fit_linear
from app.engine.mismatch.fit.free_run import free_run_error
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.law import identify_law
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import library
from app.engine.mismatch.report import probability_of
from app.engine.recording import FloatArray
from app.engine.valve import choudhury_start, choudhury_step

N = 1500
SIMULATION = LinearSimulation(0.052, (), 2.9, integrating=True)


def level(S: float, J: float, noise: float, seed: int) -> tuple[FloatArray, FloatArray]:
    """OP, PV of a level at 1 s, its PI loop in a limit cycle at a constant set point behind a sticking valve."""
    rng = np.random.default_rng(seed)
    state, op, pv, stem = np.zeros(5), np.zeros(N + 300), np.zeros(N + 300), np.zeros(N + 300)
    choudhury_start(0.0, state)
    x, summed, load = 1.0, 0.0, 0.0
    for t in range(N + 300):
        pv[t] = x + noise * rng.standard_normal()
        summed -= 1.5 * pv[t] / 40.0
        op[t] = summed - 1.5 * pv[t]
        stem[t] = choudhury_step(op[t], state, S, J)
        load = 0.95 * load + 0.06 * noise * np.sqrt(1.0 - 0.95**2) * rng.standard_normal()
        x += 0.05 * stem[max(t - 3, 0)] + load
    return 50.0 + op[300:], 50.0 + pv[300:]


def test_a_valve_that_sticks_before_a_level_is_named_whatever_the_load_walks() -> None:
    op, pv = level(2.0, 1.8, 0.1, 36)
    said = explain(Comparison("level", 1.0, op, pv, np.full(N, 50.0), simulation=SIMULATION))
    assert said.effects[0].code == "valve.stiction"


def test_the_walk_of_an_integrating_process_makes_no_free_run_worse() -> None:
    op, pv = level(2.0, 1.8, 0.1, 3)
    rng = np.random.default_rng(1)
    found = fit_linear(experiment(1.0, op, pv), Given(Plant(0.05, 1.0, 3.0, leak=0.0), integrating=True))
    right = replace(found, simulated=found.record.pv_deviation + 0.1 * rng.standard_normal(N))
    off = replace(right, simulated=right.simulated + 0.02 * np.cumsum(rng.standard_normal(N)))
    assert free_run_error(off) < 1.1 * free_run_error(right)
    regulating = replace(found.given, integrating=False)
    assert free_run_error(replace(off, given=regulating)) > 1.5 * free_run_error(replace(right, given=regulating))


def test_no_name_stands_that_another_one_beats_in_its_place() -> None:
    op, pv = level(2.0, 1.8, 0.1, 3)
    base = fit_linear(experiment(1.0, op, pv), Given(Plant(0.05, 1.0, 3.0, leak=0.0), integrating=True))
    block = library(base.record)[0]

    def named(margin: float) -> Selection:
        return Selection(base, (Believed(block.code, (), 60.0, margin, contender),), ())

    found = replace(base, likelihood=base.likelihood + 60.0, parts=(Part(block, np.ones(3)),))
    contender = Contender(found, base)
    assert stands(named(LEAST_MARGIN + 0.1))
    assert not stands(named(LEAST_MARGIN - 0.1))
    assert probability_of(named(LEAST_MARGIN + 0.01).effects[0]) >= 0.05


def test_a_law_is_read_off_the_samples_that_are_compared() -> None:
    rng = np.random.default_rng(4)
    pv = rng.standard_normal(400)
    op = -0.7 * pv - 0.05 * np.cumsum(pv)
    faulty = np.where(np.arange(400) < 150, pv + 5.0 * rng.standard_normal(400), pv)
    assert identify_law(None, faulty, op).explained < 0.8
    assert identify_law(None, faulty, op, np.arange(400) >= 150).explained > 0.99
    record = experiment(1.0, op, faulty)
    assert not record.op_follows_pv
    assert record.comparing(np.arange(400) >= 150).op_follows_pv
