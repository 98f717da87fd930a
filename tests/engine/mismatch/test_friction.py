"""Dry friction in what moves before a further lag: named where its own lag shows, else said beside a deadband; without
friction it is a lag.
"""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.loop.chain import simulate
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, lag
from app.engine.mismatch.physics import by_name
from app.engine.recording import FloatArray

N, FINE = 900, 40
K, TAU, LATE, DRY = 1.2, 16.0, 3, 2.5


def behind_friction(own: float, dry: float = DRY, seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """SP, OP, PV of a PI loop at 1 s: a spring with dry friction and a lag of its own (s), then the process, in fine
    time.
    """
    rng = np.random.default_rng(seed)
    sp = np.repeat(rng.uniform(-9.0, 9.0, N // 60), 60)
    white, e = 0.1 * rng.standard_normal(N), 0.1 * rng.standard_normal(N)
    op, pv, load, place, y, summed = np.zeros(N), np.zeros(N), 0.0, 0.0, 0.0, 0.0
    line = [0.0] * (LATE * FINE)
    for t in range(N):
        pv[t] = y + white[t]
        summed += (sp[t] - pv[t]) / TAU
        op[t] = 1.2 * (sp[t] - pv[t] + summed)
        load = 0.95 * load + e[t]
        for _ in range(FINE):
            line.append(op[t])
            off = K * line.pop(0) + load - place
            place += max(abs(off) - dry, 0.0) * np.sign(off) / FINE / own
            y += (place - y) / FINE / TAU
    return sp, op, pv


def ask(own: float, dry: float = DRY) -> Explanation:
    sp, op, pv = (50.0 + signal for signal in behind_friction(own, dry))
    return explain(Comparison("mass", 1.0, op, pv, sp, simulation=LinearSimulation(1.04 * K, (15.4,), float(LATE))))


def test_friction_before_the_lag_is_no_deadband_with_a_further_lag() -> None:
    said = ask(own=4.0)
    assert [effect.code for effect in said.effects] == ["process.friction"]
    found = {p.name: p.value for p in said.effects[0].parameters}
    assert found["dry_friction"] == pytest.approx(DRY, rel=0.1)
    assert found["own_lag"] == pytest.approx(4.0, rel=0.5)


def test_friction_of_what_answers_at_once_is_said_beside_a_deadband() -> None:
    said = ask(own=0.3)
    assert len(said.effects) == 1
    assert {"process.friction", "valve.deadband"} <= {said.effects[0].code, *said.effects[0].alternatives}


def test_a_further_lag_without_friction_is_none() -> None:
    said = ask(own=4.0, dry=0.0)
    assert [effect.code for effect in said.effects] == ["process.extra_lag"]
    assert "process.friction" not in said.effects[0].alternatives


@pytest.mark.parametrize(
    ("name", "values"), [("process.friction", [2.0, 0.3]), ("process.friction/before-the-lag", [2.0, 4.0])]
)
def test_an_inverse_response_beside_friction_leaves_its_equation(name: str, values: list[float]) -> None:
    """Its lag comes behind what has the friction: it makes no spring of a speed, and does not get lost."""
    op = np.repeat(np.random.default_rng(0).uniform(30.0, 50.0, 10), 40)
    record, plant = experiment(1.0, op, op), Plant(K, TAU, float(LATE))
    held = Part(by_name(record)[name], np.array(values))
    turned = Part(by_name(record)["process.inverse_response"], np.array([3.0, 8.0]))
    for parts in ((held, turned), (turned, held)):
        np.testing.assert_allclose(
            simulate(record, plant, parts), lag(simulate(record, plant, (held,)), 8.0, 1.0), atol=1e-9
        )
