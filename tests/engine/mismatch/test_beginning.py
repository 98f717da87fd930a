"""What a record shows of the time before it is no event of its own: a second lag that was on its way when it began."""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics.additive import BLOCKS, lasts
from app.engine.mismatch.physics.moments import inside

N, TS, BEFORE = 1500, 1.0, 12
PLANT = Plant(K=1.4, tau=30.0, theta=3.0, tau2=20.0)


def asked(added: float, seed: int) -> Explanation:
    """A second-order loop that began in the middle of its answer to a step; a load that steps at 600 s."""
    rng = np.random.default_rng(seed)
    whole = N + BEFORE
    u = np.repeat(rng.uniform(-6.0, 6.0, whole // 80 + 1), 80)[:whole] + 0.05 * rng.normal(size=whole)
    at = np.arange(whole) >= 600 + BEFORE
    pv = 50.0 + run_process(u + added * at, PLANT, TS) + 0.05 * rng.normal(size=whole)
    simulation = LinearSimulation(1.43, (29.0, 20.5), 3.0)
    return explain(Comparison("late", TS, 40.0 + u[BEFORE:], pv[BEFORE:], simulation=simulation))


def test_what_was_on_its_way_when_the_record_began_is_no_load() -> None:
    assert not any("step" in effect.code for effect in asked(0.0, 3).effects)


def test_a_load_that_steps_once_lasts_to_the_end() -> None:
    [effect] = asked(0.6, 1).effects
    assert effect.code in ("disturbance.step", "sensor.step")
    [window] = effect.windows
    assert window.start_s == pytest.approx(600.0, abs=15.0)
    assert window.end_s == N * TS


def test_a_stretch_that_reaches_an_end_of_the_record_is_a_step() -> None:
    record = experiment(TS, np.arange(N) % 7.0, np.arange(N) % 5.0)
    context = Context(record, PLANT)
    assert lasts(np.array([300.0, 700.0, 1.0]), context)
    assert not lasts(np.array([40.0, 700.0, 1.0]), context)
    assert not lasts(np.array([300.0, N - 4.0, 1.0]), context)
    # A process slower than the record does not forbid its whole beginning.
    assert inside(200.0, Context(record, PLANT.changed(tau=5000.0)))
    assert {block.form for block in BLOCKS if block.sensible is lasts} == {"pulse"}
