"""Names that a record cannot tell from another one, by the values they were found with."""

import numpy as np
import pytest

from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.naming import twins_of
from app.engine.mismatch.compete.pairing import placed
from app.engine.mismatch.fit.fitting import finish, fit_linear
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics import additive
from tests.engine import open_loop

N, TS = 600, 2.0
TAU = 30.0


def twins(name: str, lasting_s: float, tau_s: float = TAU) -> tuple[str, ...]:
    """Of what begins at 500 s and lasts so long, behind a lag."""
    u, plant = open_loop.moves(N, 60), Plant(1.4, tau_s, 4.0)
    base = fit_linear(experiment(TS, 40.0 + u, run_process(u, plant, TS) + open_loop.noise(N)), Given(plant))
    block = next(block for block in additive.BLOCKS if block.name == name)
    found = finish(*placed(base, (Part(block, np.array([500.0, lasting_s, 2.0])),)), base.noise)
    return twins_of(Contender(found, base))


@pytest.mark.parametrize("name", ["disturbance.ramp", "sensor.drift", "sensor.drift/levelling"])
def test_a_ramp_that_is_over_before_the_process_has_answered_may_be_a_step(name: str) -> None:
    assert "disturbance.step" in twins(name, 2.5 * TAU)
    assert "disturbance.step" not in twins(name, 3.5 * TAU)


def test_a_ramp_that_could_not_be_shorter_may_be_a_step() -> None:
    assert "disturbance.step" in twins("disturbance.ramp", 10.0 * TS, tau_s=3.0)
    assert "disturbance.step" not in twins("disturbance.ramp", 11.0 * TS, tau_s=3.0)
