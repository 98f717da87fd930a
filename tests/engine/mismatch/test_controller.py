"""The controller: read off the record, compared with the simulation's own, and the given simulation in closed loop."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Controller, Explanation, LinearSimulation, explain
from app.engine.mismatch.compare.comparison import check, record_of
from app.engine.mismatch.fit.closed_loop import close_again, noise_in_words
from app.engine.mismatch.fit.fitting import fit_linear
from app.engine.mismatch.fit.noise import NoiseModel
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.judge.controller import in_words
from app.engine.mismatch.loop.law import controller_of, identify_law, tried_on
from app.engine.mismatch.loop.plant import Plant, run_process
from app.errors import DataError

pytestmark = pytest.mark.usefixtures("one_competition")
N, TS = 1500, 2.0
PLANT = Plant(K=1.4, tau=30.0, theta=6.0)
RECORDED = Controller(0.9, 45.0)


def loop(controller: Controller = RECORDED) -> dict[str, np.ndarray]:
    """SP, OP and PV of a linear loop under a PID, its set point stepping, some noise on PV."""
    rng = np.random.default_rng(2)
    sp = np.repeat(50.0 + rng.uniform(-4.0, 4.0, N // 100), 100)
    noise, op, pv = 0.05 * rng.normal(size=N), np.full(N, 40.0), np.full(N, 50.0)
    law = controller.law(TS)
    e = np.zeros(N)
    e[0] = sp[0] - pv[0]
    decay, late, x = np.exp(-TS / PLANT.tau), round(PLANT.theta / TS), 0.0
    for t in range(1, N):
        u = op[t - 1 - late] - 40.0 if t > late else 0.0
        x = decay * x + PLANT.K * (1.0 - decay) * u
        pv[t] = 50.0 + x + noise[t]
        e[t] = sp[t] - pv[t]
        op[t] = op[t - 1] + law.kc * (e[t] - e[t - 1]) + law.ki * e[t] + law.kd * (e[t] - 2.0 * e[t - 1] + e[t - 2])
    return {"sp": sp, "op": op, "pv": pv}


def asked(controller: Controller | None) -> Explanation:
    simulation = LinearSimulation(PLANT.K, (PLANT.tau,), PLANT.theta, controller=controller)
    signals = loop()
    return explain(Comparison("TIC1", TS, signals["op"], signals["pv"], signals["sp"], simulation=simulation))


def codes(answer: Explanation) -> set[str]:
    return {reason.code for reason in answer.evidence}


def test_a_law_is_what_the_face_of_the_controller_shows() -> None:
    shown = Controller(0.9, 45.0, 3.0)
    signals = loop(shown)
    found = controller_of(identify_law(signals["sp"], signals["pv"], signals["op"]), TS)
    assert (found.gain, found.integral_time_s, found.derivative_time_s) == pytest.approx((0.9, 45.0, 3.0), rel=1e-3)
    alone = controller_of(Controller(0.9).law(TS), TS)
    assert (alone.gain, alone.integral_time_s, alone.derivative_time_s) == (0.9, None, 0.0)
    record = record_of(Comparison("TIC1", TS, signals["op"], signals["pv"], signals["sp"]))
    told = [in_words(controller.law(TS), record) for controller in (shown, Controller(0.9))]
    assert told == [
        "gain 0.9 OP/PV, integral time 45 s, derivative time 3 s",
        "gain 0.9 OP/PV, integral time none, derivative time none",
    ]


def test_the_same_controller_is_cleared_and_its_closed_loop_is_the_recorded_one() -> None:
    answer = asked(RECORDED)
    assert answer.verdict == "consistent"
    assert answer.located.block is None
    assert "controller_cleared" in codes(answer)
    assert "controller_differs" not in codes(answer)
    closed = answer.closed_loop
    assert closed.given_law.explained > 0.99
    assert closed.given.amplitude == pytest.approx(closed.recorded.amplitude, rel=0.1)


@pytest.mark.parametrize("other", [Controller(0.3, 45.0), Controller(0.9, 12.0), Controller(-0.9, 45.0)])
def test_another_controller_is_where_the_two_loops_differ(other: Controller) -> None:
    answer = asked(other)
    assert answer.verdict == "consistent"
    assert answer.located.block == "controller"
    [told] = answer.located.evidence
    assert told.code == "controller_differs"
    assert "gain 0.9" in told.text
    assert told in answer.evidence


def test_a_controller_that_is_not_given_is_not_compared() -> None:
    answer = asked(None)
    assert answer.closed_loop.given_law is None
    assert answer.closed_loop.given is not None
    assert answer.located.block is None


def test_where_none_is_given_no_given_loop_is_shown() -> None:
    signals = loop()
    answer = explain(Comparison("TIC1", TS, signals["op"], signals["pv"], signals["sp"]))
    assert answer.closed_loop.given is None


def sticking(S: float, slip: float, seed: int = 4) -> dict[str, np.ndarray]:
    """The loop at a constant set point under a stem that moves only when OP is S away, and then to within `slip`."""
    rng = np.random.default_rng(seed)
    noise, op, pv, stem = 0.05 * rng.normal(size=N), np.full(N, 40.0), np.full(N, 50.0), np.full(N, 40.0)
    e, x, law, decay = np.zeros(N), 0.0, RECORDED.law(TS), np.exp(-TS / PLANT.tau)
    e[0], op[0] = -3.0, 38.0
    for t in range(1, N):
        away = op[t - 1] - stem[t - 1]
        stem[t] = op[t - 1] - np.sign(away) * slip if abs(away) > S else stem[t - 1]
        u = stem[t - 3] - 40.0 if t > 3 else 0.0
        x = decay * x + PLANT.K * (1.0 - decay) * u
        pv[t] = 50.0 + x + noise[t]
        e[t] = 50.0 - pv[t]
        op[t] = op[t - 1] + law.kc * (e[t] - e[t - 1]) + law.ki * e[t]
    return {"sp": np.full(N, 50.0), "op": op, "pv": pv}


def compared(signals: dict[str, np.ndarray]) -> Explanation:
    simulation = LinearSimulation(PLANT.K, (PLANT.tau,), PLANT.theta, controller=RECORDED)
    return explain(Comparison("TIC1", TS, signals["op"], signals["pv"], signals["sp"], simulation=simulation))


def test_the_given_loop_shows_what_it_lacks_beside_the_explained_one() -> None:
    """A valve sticks in the recorded loop: the given one does not oscillate, the explained one does as recorded. By
    its noise alone such a cycle lasts 150 to 172 s.
    """
    answer = compared(sticking(1.5, 0.2, seed=8))
    assert answer.effects[0].code.startswith("valve.")
    closed = answer.closed_loop
    assert closed.given.amplitude < 0.5 * closed.recorded.amplitude
    assert closed.explained.amplitude == pytest.approx(closed.recorded.amplitude, rel=0.3)
    assert closed.explained.period_s == pytest.approx(closed.recorded.period_s, rel=0.15)


def test_noise_is_nearly_white_or_has_a_memory() -> None:
    """White noise has none worth telling: -Ts / ln(pole) is 19 s at a pole of 0.9."""
    signals = loop()
    found = fit_linear(record_of(Comparison("TIC1", TS, signals["op"], signals["pv"], signals["sp"])), Given(PLANT))
    white, slow = (noise_in_words(replace(found, noise=NoiseModel((pole, 0.0)))) for pole in (0.3, 0.9))
    assert white == "measurement noise, nearly white"
    assert slow == "coloured noise of the load, its memory 19 s"


def test_a_valve_that_never_moves_is_told_from_a_limit() -> None:
    """PV rests at its noise while the controller drives OP: no limit of PV is named for that."""
    answer = compared(sticking(5.0, 0.4))
    assert answer.verdict == "inconclusive"
    assert answer.effects == ()
    assert "a valve that does not move" in next(r.text for r in answer.evidence if r.code == "op_moves_nothing")


def test_a_law_that_is_tried_explains_what_it_explains() -> None:
    signals = loop()
    args = (signals["sp"], signals["pv"], signals["op"])
    assert tried_on(RECORDED.law(TS), *args).explained == pytest.approx(1.0, abs=1e-6)
    assert 0.95 < tried_on(Controller(0.99, 45.0).law(TS), *args).explained < 0.999
    assert tried_on(Controller(-0.9, 45.0).law(TS), *args).explained == 0.0
    assert tried_on(RECORDED.law(TS), args[0], args[1], np.full(N, 40.0)).explained == 0.0


def test_the_law_is_read_off_and_tried_where_pv_is_known() -> None:
    """A controller answers what it saw, not what a gap was filled in with."""
    signals, at = loop(), np.arange(N)
    known = at % 12 < 4
    pv = np.where(known, signals["pv"], np.interp(at, at[known], signals["pv"][known]))
    args = (signals["sp"], pv, signals["op"])
    assert tried_on(RECORDED.law(TS), *args).explained < 0.97
    assert tried_on(RECORDED.law(TS), *args, known).explained == pytest.approx(1.0, abs=1e-6)
    comparison = Comparison("TIC1", TS, signals["op"], pv, signals["sp"], known=known)
    base = fit_linear(record_of(comparison), Given(PLANT))
    closed = close_again(base, base, controller=RECORDED)
    assert closed is not None
    assert (closed.law.kc, closed.law.explained) == pytest.approx((0.9, 1.0), rel=1e-3)
    assert not closed.controller_differs


@pytest.mark.parametrize(
    ("controller", "word"),
    [
        (Controller(0.0), "gain"),
        (Controller(np.nan), "gain"),
        (Controller(1.0, 0.0), "integral time"),
        (Controller(1.0, -5.0), "integral time"),
        (Controller(1.0, 5.0, -1.0), "derivative time"),
        (Controller(1.0, 5.0, np.inf), "derivative time"),
    ],
)
def test_a_controller_that_cannot_be_is_refused(controller: Controller, word: str) -> None:
    signals = loop()
    simulation = LinearSimulation(1.4, (30.0,), controller=controller)
    with pytest.raises(DataError, match=word) as refused:
        check(Comparison("TIC1", TS, signals["op"], signals["pv"], signals["sp"], simulation=simulation))
    assert refused.value.code == "model_invalid"


def test_the_process_of_these_tests_is_the_engines() -> None:
    signals = loop()
    assert np.std(signals["pv"] - 50.0 - run_process(signals["op"] - 40.0, PLANT, TS)) < 0.06
