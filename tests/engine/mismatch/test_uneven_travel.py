"""A stem that travels faster one way than the other, as one that a spring takes back: told as such, where a level
swings behind it and one speed for both ways would walk away with the free run.
"""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain, simulate_again
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.compete.ranking import ranked
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import by_name, valve_slew_limit
from app.engine.recording import FloatArray

N, K, LATE, UP, DOWN = 1500, 0.02, 4, 0.9, 0.7


def level(up: float = UP, down: float = DOWN, load: float = 0.01, seed: int = 1) -> Comparison:
    """A PI loop around a level at 1 s whose stem is too slow for it."""
    rng = np.random.default_rng(seed)
    sp = np.repeat(rng.uniform(-5.0, 5.0, N // 150), 150)
    op, pv, v = np.zeros(N), np.zeros(N), np.zeros(N)
    x, y, summed = 0.0, 0.0, 0.0
    for t in range(N):
        pv[t] = y + 0.1 * rng.standard_normal()
        summed += 0.03 * (sp[t] - pv[t])
        op[t] = np.clip(4.0 * (sp[t] - pv[t]) + summed, -40.0, 40.0)
        x = v[t] = x + min(max(op[t] - x, -down), up)
        y += K * v[max(t - LATE, 0)] + load * rng.standard_normal()
    given = LinearSimulation(1.04 * K, (), 4.0, integrating=True)
    return Comparison("level", 1.0, 50.0 + op, 50.0 + pv, 50.0 + sp, simulation=given)


def best(comparison: Comparison) -> Part:
    """The better of both forms."""
    return ranked(prepare(comparison).base, valve_slew_limit.BLOCKS)[0].fit.parts[-1]


@pytest.mark.parametrize("times", [0.2, 5.0])
def test_a_quick_exhaust_is_found_as_quick_as_it_is(times: float) -> None:
    slow = 0.6
    up, down = (slow, times * slow) if times > 1.0 else (slow / times, slow)
    part = best(level(up, down))
    assert part.block.form == "uneven"
    assert part.values[:2] == pytest.approx([up, times], rel=0.1)


def test_speeds_that_hardly_differ_are_one() -> None:
    uneven, context = (
        valve_slew_limit.UNEVEN,
        Context(experiment(1.0, np.arange(9.0), np.arange(9.0)), Plant(1.0, 5.0, 0.0)),
    )
    apart = {
        down: Part(uneven, np.array([0.5, down, 0.0])).makes_sense(context) for down in (0.97, 0.99999, 1.00002, 1.03)
    }
    assert apart == {0.97: True, 0.99999: False, 1.00002: False, 1.03: True}


@pytest.fixture(scope="module")
def said() -> Explanation:
    return explain(level())


def test_it_is_named_with_its_speeds_and_nothing_beside_it(said: Explanation) -> None:
    assert [effect.code for effect in said.effects] == ["valve.slew_limit"]
    found = {p.name: p.value for p in said.effects[0].parameters}
    assert found["rate_up"] == pytest.approx(UP, rel=0.03)
    assert found["down"] == pytest.approx(DOWN / UP, rel=0.03)
    assert said.fit.explained.rmse < 0.2 * said.fit.refitted.rmse


def test_its_model_runs_again(said: Explanation) -> None:
    np.testing.assert_allclose(simulate_again(said.model, level().op), said.traces.explained, atol=1e-9)


def passed(name: str, op: FloatArray, *values: float) -> FloatArray:
    record = experiment(1.0, op, op)
    block = by_name(record)[name]
    assert block.apply is not None
    return block.apply(record.op_deviation, np.array(values), Context(record, Plant(K=1.0, tau=5.0, theta=0.0)))


def test_as_fast_down_as_up_it_is_the_even_one() -> None:
    op = np.repeat([0.0, 3.0, -3.0, 2.0], 20)
    np.testing.assert_array_equal(
        passed("valve.slew_limit/uneven", op, 0.5, 1.0, 0.2), passed("valve.slew_limit", op, 0.5, 0.2)
    )


def test_it_goes_down_at_its_own_speed() -> None:
    op = np.repeat([0.0, 3.0, 0.0], 20)
    moves = np.diff(passed("valve.slew_limit/uneven", op, 0.5, 0.5, 0.0))
    assert (np.max(moves), np.min(moves)) == pytest.approx((0.5, -0.25))
