"""What follows OP or PV causes nothing: read-backs and second transmitters are no couplings, true causes stay ones."""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, LinearSimulation, explain
from app.engine.mismatch.loop.causing import causes_pv
from app.engine.mismatch.loop.experiment import Experiment, experiment
from app.engine.mismatch.loop.plant import lag
from app.engine.mismatch.physics import by_name, library
from app.engine.recording import FloatArray

N = 2000
SIMULATION = LinearSimulation(1.04, (19.2,), 3.9)


def loop(seed: int, steps: bool, load: FloatArray | float = 0.0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """SP, OP, PV of a PI loop at 1 s around a first-order process with dead time; `load` (N,) is added to PV."""
    rng = np.random.default_rng(seed)
    sp = np.repeat(rng.uniform(-5.0, 5.0, N // 100), 100) * steps
    added = load + np.zeros(N)
    op, pv, x, summed, own = np.zeros(N), np.zeros(N), 0.0, 0.0, 0.0
    for t in range(N):
        pv[t] = x + 0.15 * rng.standard_normal() + added[t]
        summed += 1.2 * (sp[t] - pv[t]) / 20.0
        op[t] = 1.2 * (sp[t] - pv[t]) + summed
        own = 0.95 * own + 0.12 * rng.standard_normal()
        x += (1.0 - np.exp(-1.0 / 20.0)) * (op[max(t - 4, 0)] + own - x)
    return sp + 50.0, op + 40.0, pv + 50.0


def slow(seed: int, pole: float = 0.97) -> FloatArray:
    rng, out = np.random.default_rng(seed), np.zeros(N)
    for t in range(1, N):
        out[t] = pole * out[t - 1] + 2.0 * np.sqrt(1.0 - pole**2) * rng.standard_normal()
    return out


def recorded(signals: tuple[FloatArray, FloatArray, FloatArray]) -> Experiment:
    sp, op, pv = signals
    return experiment(1.0, op, pv, sp)


@pytest.mark.parametrize("steps", [True, False])
@pytest.mark.parametrize("samples", [0.0, 1.0, 2.5])
def test_what_follows_op_or_pv_is_no_cause(steps: bool, samples: float) -> None:
    record, noise = recorded(loop(1, steps)), np.random.default_rng(2).standard_normal(N)
    assert not causes_pv(lag(record.op, samples, 1.0) + 0.05 * noise, record)
    assert not causes_pv(lag(record.pv, samples, 1.0) + 0.05 * noise, record)
    assert not causes_pv(noise, record)


@pytest.mark.parametrize("steps", [True, False])
@pytest.mark.parametrize(("tau", "late"), [(0.0, 0), (5.0, 3), (2.0, 30)])
def test_a_cause_stays_one_in_a_loop_that_answers_it(steps: bool, tau: float, late: int) -> None:
    cause = slow(3)
    acting = 0.6 * lag(np.concatenate((np.full(late, cause[0]), cause[: N - late])), tau, 1.0)
    record = recorded(loop(4, steps, acting))
    assert causes_pv(cause + 0.1 * np.random.default_rng(5).standard_normal(N), record)
    assert not causes_pv(slow(6), record)


def test_a_cause_that_jumps_once_is_not_taken_for_what_the_loop_moves() -> None:
    """Of 26 columns of OP's and PV's past one stands out at the jump by chance, and it is most of what is foretold."""
    cause = slow(30, 0.995)
    cause[1040:] -= 3.0
    acting = 0.3 * lag(np.concatenate((np.full(7, cause[0]), cause[: N - 7])), 20.0, 1.0)
    assert causes_pv(cause, recorded(loop(67, True, acting)))


def test_a_read_back_that_jumps_once_stays_one() -> None:
    record = recorded(loop(1, True))
    for signal in (record.op, record.pv):
        read_back = lag(signal, 1.0, 1.0) + 0.05 * np.random.default_rng(2).standard_normal(N)
        read_back[700:] += 20.0
        assert not causes_pv(read_back, record)


@pytest.mark.parametrize("steps", [True, False])
def test_a_second_transmitter_is_no_cause(steps: bool) -> None:
    """It helps to predict PV, because its noise is its own; but PV and OP tell as much of it."""
    signals = loop(9, steps)
    own = 0.15 * np.random.default_rng(9).standard_normal(N)
    record = recorded((signals[0], signals[1], signals[2] + own))
    assert not causes_pv(signals[2], record)


@pytest.mark.parametrize("seed", [0, 2, 4, 6])
def test_what_lags_behind_pv_without_its_noise_is_no_cause(seed: int) -> None:
    """A vessel further on knows PV without the noise of its sensor, and so tells much of it; PV and OP tell of it."""
    rng = np.random.default_rng(seed)
    op, pv, true, x, summed, load = np.zeros(1200), np.zeros(1200), np.zeros(1200), 0.0, 0.0, 0.0
    for t in range(1200):
        true[t], pv[t] = x, x + 0.1 * rng.standard_normal()
        summed -= 0.8 * pv[t] / 30.0
        op[t] = summed - 0.8 * pv[t]
        load = 0.97 * load + 0.2 * rng.standard_normal()
        x += (1.0 - np.exp(-1.0 / 30.0)) * (1.5 * op[max(t - 4, 0)] + load - x)
    further = lag(true, 60.0, 1.0)
    further += 0.01 * np.std(further) * rng.standard_normal(1200)
    assert not causes_pv(further, experiment(1.0, op, pv, np.zeros(1200)))


def test_a_cause_that_moves_seldom_is_one() -> None:
    """Ten jumps that are felt in passing say something of few samples only."""
    cause = np.repeat(np.random.default_rng(9).uniform(-3.0, 3.0, 10), N // 10)
    late = np.concatenate((np.full(9, cause[0]), cause[: N - 9]))
    record = recorded(loop(4, True, late - lag(late, 60.0, 1.0)))
    assert causes_pv(cause + 0.05 * np.random.default_rng(5).standard_normal(N), record)
    assert not causes_pv(np.roll(cause, 333), record)


def test_a_read_back_is_not_offered_but_known() -> None:
    record = recorded(loop(1, False))
    with_it = experiment(1.0, record.op, record.pv, record.sp, (("ZT", record.op + 0.0), ("FI", slow(6))))
    assert not [block for block in library(with_it) if block.code == "disturbance.coupling"]
    assert "disturbance.coupling/ZT" in by_name(with_it)


def test_samples_that_are_not_compared_prove_nothing() -> None:
    cause = slow(3)
    record = recorded(loop(4, True, 0.6 * lag(cause, 3.0, 1.0)))
    assert causes_pv(cause, record.comparing(np.arange(N) < 1000))
    lost = np.where(np.arange(N) < 1000, cause, record.op)
    assert not causes_pv(lost, record)


def test_a_read_back_accuses_no_clean_loop() -> None:
    sp, op, pv = loop(1, False)
    said = explain(Comparison("ZT", 1.0, op, pv, sp, (("ZT", lag(op, 1.0, 1.0)),), simulation=SIMULATION))
    assert said.effects == ()
