"""Effects that the library does not have are no name's: something unnamed is said, or a name that is not sure."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain, simulate_again
from app.engine.mismatch.compete.naming import Believed
from app.engine.mismatch.fit.fitting import fit_linear
from app.engine.mismatch.fit.task import Given
from app.engine.mismatch.judge import doubting
from app.engine.mismatch.judge.adequacy import Pays, lack_of_fit
from app.engine.mismatch.judge.doubting import HALF_SURE, HALF_SURE_OWN, doubted, runs_astray, without_name
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import named
from app.engine.mismatch.physics.terms import PRICE, SHAPES, Drives, kind_of, made_of
from app.engine.recording import FloatArray

pytestmark = pytest.mark.usefixtures("one_competition")
N, TAU, LATE = 1500, 16.0, 3
SIMULATION = LinearSimulation(1.03, (15.5,), 3.0)
Step = Callable[[float, float], float]


def towards(x: float, to: float, tau: float) -> float:
    return to + (x - to) * float(np.exp(-1.0 / max(tau, 1e-9)))


def linear(x: float, drive: float) -> float:
    return towards(x, drive, TAU)


def quicker_up(x: float, drive: float) -> float:
    return towards(x, drive, TAU * (0.6 if drive > x else 1.7))


def quicker_below(x: float, drive: float) -> float:
    return towards(x, drive, TAU * float(np.exp(np.clip(0.16 * x, -1.5, 1.5))))


def as_it_is(shown: float, x: float) -> float:
    return x


def warms_slowly(shown: float, x: float) -> float:
    return towards(shown, x, 12.0 if x > shown else 1.0)


def loop(process: Step, sensor: Step = as_it_is, seed: int = 3) -> tuple[FloatArray, FloatArray, FloatArray]:
    """SP, OP, PV of a PI loop at 1 s around a process and a sensor, each a step of its state towards what drives it."""
    rng = np.random.default_rng(seed)
    sp = np.repeat(rng.uniform(-8.0, 8.0, N // 100), 100)
    white, e = 0.08 * rng.standard_normal(N), rng.standard_normal(N)
    op, pv, x, shown, summed, load = np.zeros(N), np.zeros(N), 0.0, 0.0, 0.0, 0.0
    for t in range(N):
        shown = sensor(shown, x)
        pv[t] = shown + white[t]
        summed += (sp[t] - pv[t]) / 18.0
        op[t] = sp[t] - pv[t] + summed
        load = 0.95 * load + 0.1 * e[t]
        x = process(x, op[max(t - LATE, 0)] + load)
    return sp + 50.0, op + 40.0, pv + 50.0


def ask(signals: tuple[FloatArray, FloatArray, FloatArray]) -> Explanation:
    sp, op, pv = signals
    return explain(Comparison("outside", 1.0, op, pv, sp, simulation=SIMULATION))


@cache
def told(process: Step, sensor: Step, seed: int) -> Explanation:
    return ask(loop(process, sensor, seed))


@pytest.mark.parametrize(("process", "sensor"), [(quicker_below, as_it_is), (linear, warms_slowly)])
def test_what_fits_nothing_in_the_library_is_unnamed(process: Step, sensor: Step) -> None:
    said = told(process, sensor, 3)
    first = said.effects[0]
    assert first.code == "unnamed"
    assert first.condition.startswith("while OP moves: dynamic")
    assert all(effect.probability < 0.6 for effect in said.effects if effect.code != "unnamed")
    assert said.fit.explained.rmse < said.fit.refitted.rmse


def test_names_that_explain_as_much_as_terms_without_one_are_unsure_where_more_is_left() -> None:
    """A bent scale and a limit together come near what is slower down than up: nobody should rely on either."""
    said = told(quicker_up, as_it_is, 3)
    assert {effect.code for effect in said.effects} == {"process.nonlinear_gain", "valve.saturation"}
    assert all(effect.probability < 0.3 for effect in said.effects)
    assert all("lack_of_fit" in {reason.code for reason in effect.evidence} for effect in said.effects)


def test_terms_that_run_astray_where_they_have_not_seen_take_no_name_s_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """They bend with whatever is there: a right pair lost its place to terms that ran five times as far off."""
    sp, op, pv = loop(quicker_up)
    record = experiment(1.0, op, pv, sp)
    names = fit_linear(record, Given(Plant(K=1.0, tau=TAU, theta=float(LATE))))
    unnamed = without_name(names, lack_of_fit(names))
    assert not runs_astray(names, unnamed.fit)
    assert runs_astray(unnamed.fit, names)
    monkeypatch.setattr(doubting, "runs_astray", lambda *_: True)
    assert ask((sp, op, pv)).effects[0].code != "unnamed"


def test_the_generic_term_can_be_simulated_again() -> None:
    said = told(quicker_below, as_it_is, 3)
    assert said.effects[0].code == "unnamed"
    again = simulate_again(said.model, loop(quicker_below, seed=3)[1])
    assert said.traces.explained == pytest.approx(again)


def test_a_right_name_leaves_nothing() -> None:
    said = ask(loop(lambda x, drive: towards(x, float(np.clip(drive, -5.0, 5.0)), TAU)))
    assert said.effects[0].code == "valve.saturation"
    assert said.effects[0].probability > 0.9
    assert "lack_of_fit" not in {reason.code for reason in said.effects[0].evidence}


def test_a_linear_loop_leaves_nothing_to_terms_and_another_does() -> None:
    for process, least in ((linear, 0.0), (quicker_up, 40.0)):
        sp, op, pv = loop(process)
        base = fit_linear(experiment(1.0, op, pv, sp), Given(Plant(K=1.0, tau=TAU, theta=float(LATE))))
        left = sum(term.gain for term in lack_of_fit(base))
        assert left > least if least else left == 0.0


def test_a_generic_block_says_what_its_terms_are() -> None:
    assert kind_of(("op_2_lagged",)) == "while OP moves: static, additive, before the lag, without memory"
    assert kind_of(("op_times_lag_3",)) == "while OP moves: dynamic, multiplicative, behind the lag, with memory"
    block = made_of(("op_2", "pv_speed"))
    assert block.penalty == 2 * PRICE
    sp, op, pv = loop(linear)
    record = experiment(1.0, op, pv, sp)
    known = named(record, [block.name, "unnamed/terms:nonsense", "nonsense"])
    assert list(known) == [block.name]
    context = Context(record, Plant(K=1.0, tau=TAU, theta=float(LATE)))
    assert [p.name for p in known[block.name].parameters(context)] == ["op_2", "pv_speed"]
    drives = Drives(context, pv - 50.0)
    assert all(np.all(np.isfinite(shape.make(drives))) for shape in SHAPES.values())


def test_a_name_is_less_sure_for_what_it_leaves_and_what_has_none_is_not() -> None:
    left = (Pays("op_2", 30.0), Pays("pv_speed", 20.0))
    codes = ("valve.deadband", "unnamed")
    name, unnamed = (doubted(Believed(code, (), 100.0, np.inf, None), left, HALF_SURE) for code in codes)
    assert name.most < 0.1
    own = doubted(Believed("valve.deadband", (), 100.0, np.inf, None), left, HALF_SURE_OWN)
    assert name.most < 0.5 < own.most < 0.7
    assert [reason.code for reason in name.left] == ["lack_of_fit"]
    assert unnamed.most == 1.0
    little = doubted(Believed("valve.deadband", (), 100.0, np.inf, None), (Pays("op_2", 2.0),), HALF_SURE)
    assert [said.left[0].text.endswith("the physics may be different") for said in (name, little)] == [True, False]
