"""What makes PV late: dead time, lags and inverse responses, told apart where the record does, else said together."""

import numpy as np
import pytest
from scipy.signal import cont2discrete

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.loop.beginning import answers_the_record
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.chain import simulate
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics import LATE, NEAR, TWINS, by_name
from app.engine.mismatch.physics.process_dynamics import inverse
from app.engine.recording import FloatArray

N, FINE = 2000, 20


def behind(u: float, states: list[float], taus: tuple[float, ...]) -> float:
    """One fine step of lags in a row; states are changed in place."""
    for k, tau in enumerate(taus):
        states[k] += (1.0 - np.exp(-1.0 / FINE / tau)) * (u - states[k])
        u = states[k]
    return u


def loop(
    taus: tuple[float, ...], theta: float, seed: int, loud: float = 1.0, cut: int = 0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """SP, OP, PV of a PI loop at 1 s whose set point jumps at the first instant; `cut` samples are not recorded."""
    rng = np.random.default_rng(seed)
    n = N + cut
    sp = np.repeat(rng.uniform(-5.0, 5.0, n // 120 + 1), 120)[:n]
    white, e = 0.1 * loud * rng.standard_normal(n), rng.standard_normal(n)
    states, line = [0.0] * len(taus), [0.0] * round(theta * FINE)
    op, pv, y, summed, load = np.zeros(n), np.zeros(n), 0.0, 0.0, 0.0
    for t in range(n):
        pv[t] = y + white[t]
        summed += (sp[t] - pv[t]) / 20.0
        op[t] = sp[t] - pv[t] + summed
        load = 0.95 * load + 0.3 * loud * np.sqrt(1.0 - 0.95**2) * e[t]
        for _ in range(FINE):
            line.append(op[t])
            y = behind(line.pop(0) + load, states, taus)
    return tuple(50.0 + signal[cut:] for signal in (sp, op, pv))


def ask(signals: tuple[FloatArray, FloatArray, FloatArray], simulation: LinearSimulation) -> Explanation:
    sp, op, pv = signals
    return explain(Comparison("late", 1.0, op, pv, sp, simulation=simulation))


def test_an_inverse_response_behind_a_lag_is_that_of_its_equation() -> None:
    """K (1 - zero s) / ((tau s + 1) (lag s + 1)), OP held over each sample."""
    u, (K, tau, zero, lag_s, ts) = np.random.default_rng(0).normal(size=500), (1.4, 30.0, 12.0, 9.0, 5.0)
    a, b = np.array([[-1.0 / tau, 0.0], [1.0 / lag_s, -1.0 / lag_s]]), np.array([[K / tau], [0.0]])
    a, b, *_ = cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), ts)
    x, expected = np.zeros(2), np.zeros(len(u))
    for t in range(1, len(u)):
        x = a @ x + b[:, 0] * u[t - 1]
        expected[t] = x[1] - zero / lag_s * (x[0] - x[1])
    plant = Plant(K, tau, 0.0)
    context = Context(experiment(ts, u, u), plant)
    np.testing.assert_allclose(
        run_process(u, inverse(plant, np.array([zero, lag_s]), context), ts), expected, atol=1e-9
    )


@pytest.mark.parametrize("name", ["process.integrating", "process.integrating/leaky", "process.resonance"])
def test_an_inverse_response_beside_another_process_is_the_same_in_either_order(name: str) -> None:
    op = np.random.default_rng(0).normal(size=500)
    record, plant = experiment(5.0, op, op), Plant(1.4, 30.0, 6.0)
    block = by_name(record)[name]
    other = Part(block, block.starts(Context(record, plant), op)[0])
    turned = Part(by_name(record)["process.inverse_response"], np.array([12.0, 9.0]))
    both, reversed_ = simulate(record, plant, (other, turned)), simulate(record, plant, (turned, other))
    np.testing.assert_allclose(both, reversed_, atol=1e-9)


@pytest.mark.parametrize(("cut", "seed"), [(0, 17), (250, 18)])
def test_what_op_did_before_the_record_is_no_missing_physics(cut: int, seed: int) -> None:
    """A process with 3 s of dead time more, from a jump at the first instant; with a lag of 3 s more, cut out of a
    longer record: both answer at first what no free run knows.
    """
    taus, theta = ((20.0, 5.0), 7.0) if cut == 0 else ((20.0, 5.0, 3.0), 4.0)
    said = ask(loop(taus, theta, seed, cut=cut), LinearSimulation(1.04, (19.2, 5.2), 3.9))
    assert said.effects[0].code == ("process.dead_time" if cut == 0 else "process.extra_lag")
    assert len(said.effects) == 1


def test_a_dead_time_with_a_lag_is_not_surely_an_inverse_response() -> None:
    said = ask(loop((20.0, 4.0), 7.0, 23), LinearSimulation(1.04, (19.2,), 3.9))
    told = {name for effect in said.effects for name in (effect.code, *effect.alternatives)}
    assert {"process.dead_time", "process.extra_lag"} <= told


def test_a_lag_that_shows_clearly_is_one_name() -> None:
    said = ask(loop((20.0, 5.0), 4.0, 10), LinearSimulation(1.04, (19.2,), 3.9))
    assert [(e.code, e.alternatives) for e in said.effects] == [("process.extra_lag", ("sensor.lag",))]
    assert said.effects[0].probability > 0.9


def test_alternatives_without_an_own_gain_are_said_and_lower_no_probability() -> None:
    """Loud noise: each of the three explains nearly the same, and one of them surely."""
    said = ask(loop((20.0, 5.0), 7.0, 17, loud=2.5), LinearSimulation(1.04, (19.2, 5.2), 3.9))
    first = said.effects[0]
    assert {first.code, *first.alternatives} - {"sensor.lag"} <= LATE
    assert len(first.alternatives) >= 1
    assert first.probability > 0.9


def test_what_cannot_be_told_apart_is_said_both_ways() -> None:
    for code, others in TWINS.items():
        assert all(code in TWINS[other] for other in others)
    assert "sensor.drift" in TWINS["disturbance.ramp"]
    assert LATE in NEAR


def test_only_what_answers_the_record_is_compared() -> None:
    record = experiment(2.0, np.arange(400.0), np.arange(400.0) ** 2)
    first = Plant(K=1.0, tau=8.0, theta=4.0)
    assert np.argmax(answers_the_record(record, first)) == 2
    assert np.argmax(answers_the_record(record, first.changed(tau2=2.0))) == 5
    assert np.argmax(answers_the_record(record, first.changed(theta=1000.0))) == 20
    short = record.comparing(np.arange(400) < 101)
    assert answers_the_record(short, first).sum() == 100
