"""A contender is fitted to its end, and stays where it began where the way on ends in a worse valley."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch.compete import competition
from app.engine.mismatch.compete.competition import begin, pursue, survey
from app.engine.mismatch.fit.fitting import Fit, fit_linear
from app.engine.mismatch.fit.task import Given, Task
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.physics import by_name
from tests.engine.plain_loop import TRUE, TS, N, moves, recorded


@pytest.mark.parametrize("nats", [50.0, -50.0])
def test_a_contender_is_no_worse_than_it_began(monkeypatch: pytest.MonkeyPatch, nats: float) -> None:
    op = 40.0 + moves(seed=3)
    record = experiment(TS, op, recorded(op - 40.0, np.where(np.arange(N) >= N // 2, 1.5, 0.0)))
    base = fit_linear(record, Given(TRUE))
    block = by_name(record)["sensor.step"]
    begun = begin(survey(base, (block,))[0], base)

    def elsewhere(task: Task, x: np.ndarray, *_: object) -> Fit:
        return replace(begun[0], likelihood=begun[0].likelihood + nats)

    monkeypatch.setattr(competition, "fit", elsewhere)
    assert pursue(block, begun).likelihood == begun[0].likelihood + max(nats, 0.0)
