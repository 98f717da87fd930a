"""PV that is measured once an interval and held until the next time: named with its interval, compared at its
instants, and no other repeated value taken for it.
"""

from functools import partial

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Controller, LinearSimulation, explain, simulate_again
from app.engine.mismatch.compare.patterns import find_patterns
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.compare.sampling import as_compared, hold_of, taken_of
from app.engine.mismatch.judge import conclude
from app.engine.mismatch.judge.conclude import told_by_op
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics.sample_hold import SAMPLE_HOLD
from app.engine.recording import FloatArray
from app.engine.simulate.compression import keep, rebuild
from tests.engine import open_loop
from tests.engine.mismatch.conftest import Compete

pytestmark = pytest.mark.usefixtures("one_competition")
N, TS = 1600, 2.0
INSTANTS = np.arange(N) * TS
TRUE = Plant(K=1.4, tau=30.0, theta=6.0)
GIVEN = LinearSimulation(gain=1.45, time_constants_s=(28.5,), dead_time_s=6.0)
moves, noise = partial(open_loop.moves, N, 50), partial(open_loop.noise, N)
INTERVALS = (1.5, 2.0, 2.5, 3.0, 4.0, 6.6, 7.25, 9.0, 20.0, 40.0)  # samples


def recorded(v: FloatArray) -> FloatArray:
    return 50.0 + run_process(v, TRUE, TS) + noise()


def held(pv: FloatArray, every: float, first: float = 0.0) -> FloatArray:
    """PV taken at first + m every (samples), shown from the next sample on until the next."""
    taken = np.ceil(np.arange(first - every, N - 1, every) - 1e-9).astype(np.int64)
    return pv[np.maximum(taken, 0)[np.searchsorted(taken, np.arange(N), side="right") - 1]]


def codes(pv: FloatArray) -> list[str]:
    return [p.part.block.code for p in find_patterns(experiment(TS, moves(), pv))]


@pytest.mark.parametrize("every", INTERVALS)
@pytest.mark.parametrize("late", [0.0, 0.6])
def test_a_hold_is_named_with_its_interval(every: float, late: float) -> None:
    pv = held(recorded(moves()), every, late * every)
    for shown in (pv, np.round(pv, 3)):
        (found,) = find_patterns(experiment(TS, moves(), shown))
        assert found.part.block.code == "sensor.sample_hold"
        assert found.part.values[0] == pytest.approx(every * TS, rel=0.05)


def test_a_hold_whose_scan_comes_a_little_early_or_late_is_one() -> None:
    taken = np.arange(0, N, 12)
    taken[1:] += np.random.default_rng(1).integers(-1, 2, len(taken) - 1)
    pv = recorded(moves())[taken[np.searchsorted(taken, np.arange(N), side="right") - 1]]
    assert codes(pv) == ["sensor.sample_hold"]


@pytest.mark.parametrize("period", [12, 14, 16])
def test_a_clean_wave_that_rails_is_no_hold(period: int) -> None:
    """Half of its changes follow at once, half after a rest: the median of their spacings is near none of them."""
    wave = np.clip(5.0 * np.sin(2.0 * np.pi * np.arange(15 * period) / period + 0.1), -1.0, 1.0)
    assert hold_of(wave) is None


def test_other_values_that_repeat_are_no_hold() -> None:
    pv, rng = recorded(moves()), np.random.default_rng(2)
    stuck = pv.copy()
    stuck[500:560] = stuck[499]
    irregular = np.concatenate(([0], np.sort(rng.choice(np.arange(1, N), N // 6, replace=False))))
    wave = 50.0 + 5.0 * np.sin(2.0 * np.pi * np.arange(N) / 60.0)
    others = [pv, stuck, np.minimum(pv, 53.0), np.interp(np.arange(N), np.arange(0, N, 9), pv[::9])]
    others += [np.round(pv, digits) for digits in (1, 2, 3)] + [0.8 * np.round(pv / 0.8)]
    others += [pv[irregular[np.searchsorted(irregular, np.arange(N), side="right") - 1]]]
    for signal in (pv, wave):
        for width in (0.05, 0.2, 0.4, 1.0):
            for kind in ("exception", "swinging_door"):
                others.append(rebuild(INSTANTS, signal, keep(INSTANTS, signal, width, kind), kind))
    for other in others:
        assert "sensor.sample_hold" not in codes(other)


@pytest.mark.parametrize("every", [2.0, 3.5, 9.0])
def test_nothing_is_named_beside_a_hold_and_the_model_is_found(every: float) -> None:
    u = moves()
    answer = explain(Comparison("analyser", TS, 40.0 + u, held(recorded(u), every, 1.0), simulation=GIVEN))
    assert [effect.code for effect in answer.effects] == ["sensor.sample_hold"]
    assert answer.effects[0].parameters[0].value == pytest.approx(every * TS, rel=0.01)
    plant = dict(answer.model.plant)
    assert plant["K"] == pytest.approx(1.4, rel=0.03)
    assert plant["tau"] == pytest.approx(30.0, rel=0.1)
    assert plant["theta"] == pytest.approx(6.0, abs=2.0)


def with_backlash() -> Comparison:
    u, v, x = moves(), np.empty(N), 0.0
    for t in range(N):
        x = min(max(x, u[t] - 1.0), u[t] + 1.0)
        v[t] = x
    return Comparison("analyser", TS, 40.0 + u, held(recorded(v), 4.0), simulation=GIVEN)


def test_what_is_missing_beside_a_hold_is_still_named() -> None:
    u, answer = moves(), explain(with_backlash())
    assert answer.effects[0].code == "sensor.sample_hold"
    assert "valve.deadband" in (answer.effects[1].code, *answer.effects[1].alternatives)
    pv = recorded(u)
    assert codes(np.minimum(held(pv, 4.0), np.quantile(pv, 0.6))) == ["sensor.sample_hold"]
    limited = np.minimum(held(pv, 4.0), 53.0)
    answer = explain(Comparison("analyser", TS, 40.0 + u, limited, simulation=GIVEN))
    assert [effect.code for effect in answer.effects] == ["sensor.sample_hold", "sensor.saturation"]


def test_the_same_op_tells_no_more_than_itself_beside_a_hold(
    one_competition: Compete, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An OP at other times is simulated along the same samples: that of a whole record later is this one."""
    whole = with_backlash()
    taken = taken_of(whole)
    final = one_competition(prepare(as_compared(whole, taken), taken)).selection.fit
    assert final.record.finer is not None
    assert final.parts
    monkeypatch.setattr(conclude, "SHIFTS", (1.0,) * 5)
    assert told_by_op(final, 10.0) == pytest.approx(0.0, abs=2.0)


def test_a_simulated_trace_is_compared_where_pv_was_taken_and_the_model_holds_alike() -> None:
    u, every = moves(), 5.5
    pv = held(recorded(u), every)
    trace = 50.0 + run_process(u, Plant(K=1.45, tau=28.5, theta=6.0), TS)
    answer = explain(Comparison("analyser", TS, 40.0 + u, pv, trace=trace))
    assert [effect.code for effect in answer.effects] == ["sensor.sample_hold"]
    assert answer.model.rest == ()
    again = simulate_again(answer.model, 40.0 + u)
    assert len(again) == N
    assert len(np.unique(again)) == pytest.approx(N / every, abs=2)
    assert np.std(again - pv) < 0.3 * np.std(pv)


@pytest.mark.parametrize("every", [1.0, 2.5, 6.0])
def test_what_is_simulated_is_sampled_and_held_alike(every: float) -> None:
    pv = recorded(moves())
    context = Context(experiment(TS, moves(), pv), TRUE)
    part = Part(SAMPLE_HOLD, np.array([every * TS]))
    assert part.block.apply is not None
    shown = part.block.apply(pv, part.values, context)
    changes = np.flatnonzero(np.diff(shown)) + 1
    assert np.mean(np.diff(changes)) == pytest.approx(every, rel=0.01)
    np.testing.assert_array_equal(shown[changes], pv[changes])


def test_a_hold_is_seen_through_what_single_samples_do() -> None:
    """A scan that comes a sample late, a value between two instants, values that were filled in."""
    rng = np.random.default_rng(8)
    pv = recorded(moves())
    late = np.minimum(np.arange(0, N, 5) + rng.integers(0, 2, len(range(0, N, 5))), N - 1)
    jittered = pv[late[np.maximum(np.searchsorted(late, np.arange(N), side="right") - 1, 0)]]
    assert hold_of(jittered).interval == pytest.approx(5.0, rel=0.02)
    stray = held(pv, 4.0)
    stray[1001] += 0.3
    assert hold_of(stray).interval == 4.0
    empty = held(pv, 4.0)
    at = np.sort(rng.choice(N, N // 33, replace=False))
    kept = np.delete(np.arange(N), at)
    assert hold_of(np.interp(np.arange(N), kept, empty[kept])).interval == 4.0


def test_a_long_held_record_is_compared_with_its_trace() -> None:
    n = 9000
    rng = np.random.default_rng(5)
    u = np.repeat(rng.uniform(-6.0, 6.0, n // 60), 60)
    pv = 50.0 + run_process(u, TRUE, TS) + 0.1 * rng.normal(size=n)
    trace = 50.0 + run_process(u, TRUE.changed(K=1.45), TS)
    answer = explain(Comparison("long", TS, 40.0 + u, pv[np.arange(n) // 4 * 4], trace=trace))
    assert [effect.code for effect in answer.effects] == ["sensor.sample_hold"]


@pytest.mark.parametrize("every", [10, 25])
def test_the_controller_is_judged_by_what_it_saw(every: int) -> None:
    """A PI controller that acts each second on a PV that is taken every so many."""
    rng = np.random.default_rng(6)
    n, gain, integral = 3000, 0.4, 40.0
    sp = np.repeat(50.0 + rng.uniform(-4.0, 4.0, n // 150), 150)
    op, pv, x, shown, before = np.full(n, 40.0), np.full(n, 50.0), 0.0, 50.0, 0.0
    for t in range(1, n):
        x += (1.0 - np.exp(-1.0 / 30.0)) * (1.4 * (op[max(t - 4, 0)] - 40.0) - x)
        shown = 50.0 + x + 0.05 * rng.normal() if t % every == 0 else shown
        pv[t] = shown
        error = sp[t] - shown
        op[t] = op[t - 1] + gain * (error - before) + gain / integral * error
        before = error
    model = LinearSimulation(1.4, (30.0,), 3.0, controller=Controller(gain, integral))
    answer = explain(Comparison("held", 1.0, op, pv, sp, simulation=model))
    assert "controller_differs" not in {reason.code for reason in answer.evidence}
    assert answer.closed_loop.law.kc == pytest.approx(gain, rel=0.01)
    assert answer.closed_loop.law.ki == pytest.approx(gain * every / integral, rel=0.02)
