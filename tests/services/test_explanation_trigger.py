"""The residual of a coupling is drawn against the measured signal that moves PV, whichever form was found."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, explain
from app.engine.mismatch.judge.result import Estimate
from app.services.explaining.trigger import trigger_of
from tests.engine.plain_loop import GIVEN, TS, N, moves, noise, recorded

FEED = np.repeat(np.random.default_rng(5).uniform(-1.0, 1.0, N // 40), 40)
OTHER = noise(9)


@pytest.fixture(scope="module")
def coupled() -> tuple[Explanation, Comparison]:
    op = 40.0 + moves(seed=3)
    pv = recorded(op - 40.0, 3.0 * np.roll(FEED, 4))
    loop = Comparison("coupled", TS, op, pv, measured=(("feed", FEED), ("s/feed", OTHER)), simulation=GIVEN)
    return explain(loop), loop


@pytest.mark.parametrize("cause", ["feed", "s/feed"])
@pytest.mark.parametrize("by", ["PV", "PV/s"])
def test_a_coupling_is_drawn_against_its_cause(coupled: tuple[Explanation, Comparison], cause: str, by: str) -> None:
    """Where the process integrates the gain is one a second."""
    told, loop = coupled
    first = told.effects[0]
    assert first.code == "disturbance.coupling"
    gain = Estimate("gain", 1.0, 0.9, 1.1, f"{by}/{cause}")
    effect = replace(first, condition=first.condition.replace("feed", cause), parameters=(gain, *first.parameters[1:]))
    trigger = trigger_of(replace(told, effects=(effect,)), loop)
    assert trigger.label == f"{cause}, in its unit"
    assert trigger.values == pytest.approx(dict(loop.measured)[cause])
