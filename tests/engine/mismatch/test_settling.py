"""What is fitted again by its free run alone keeps what its names say."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch.fit import free_run
from app.engine.mismatch.fit.fitting import Fit, fit_linear
from app.engine.mismatch.fit.given import Given
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics import by_name
from tests.engine import open_loop

N, TRUE = 400, Plant(K=1.4, tau=30.0, theta=6.0)
STRETCH, SPIKE = np.array([200.0, 600.0, 1.0]), np.array([300.0, 302.0, 1.0])


def fitted(*stretches: np.ndarray) -> Fit:
    """A fit whose noise is nearly a random walk, with a load and a sensor that are off for a while."""
    record = experiment(2.0, open_loop.moves(N, 50), run_process(open_loop.moves(N, 50), TRUE, 2.0))
    blocks = (by_name(record)["disturbance.step/pulse"], by_name(record)["sensor.step/pulse"])
    found = fit_linear(record, Given(TRUE))
    parts = tuple(Part(block, values) for block, values in zip(blocks, stretches, strict=True))
    return replace(found, parts=parts, noise=replace(found.noise, poles=(0.99, *found.noise.poles[1:])))


@pytest.mark.parametrize(
    ("before", "after", "kept"),
    [
        ((STRETCH, SPIKE), (STRETCH, STRETCH), True),
        ((STRETCH, SPIKE), (STRETCH, SPIKE), True),
        ((STRETCH, STRETCH), (STRETCH, SPIKE), False),
        ((STRETCH, SPIKE), (SPIKE, STRETCH), False),
    ],
)
def test_each_part_that_makes_sense_still_does(
    monkeypatch: pytest.MonkeyPatch, before: tuple[np.ndarray, ...], after: tuple[np.ndarray, ...], kept: bool
) -> None:
    found, other = fitted(*before), fitted(*after)
    monkeypatch.setattr(free_run, "white_fit", lambda one: one.x)
    monkeypatch.setattr(free_run, "finish", lambda *_: other)
    monkeypatch.setattr(free_run, "error_left", lambda one, _: 0.5 if one is other else 1.0)
    assert (free_run.settle(found) is other) == kept
