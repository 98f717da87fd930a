"""A valve that begins to stick amid a record, or whose backlash grows along it, is named by what it does and dated."""

from collections.abc import Callable

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics.valve_deadband import grows
from app.engine.mismatch.physics.valve_stiction import SETS_IN, sets_in
from app.engine.recording import FloatArray
from app.engine.valve import choudhury_start, choudhury_step, he_stem
from app.engine.valve.he import he_step

N, TAU, LATE = 1800, 20.0, 4
S, J = 4.0, 1.5
Stem = Callable[[int, float, float], float]


def asked(seed: int, stem: Stem) -> Explanation:
    """A PI loop at 1 s: a gain of 1.3, 20 s of lag, 4 s of dead time. stem: of sample, OP and where it was, where it
    is.
    """
    rng = np.random.default_rng(seed)
    sp = np.repeat(rng.uniform(-5.0, 5.0, N // 150), 150)
    pv, op, line, y, summed, load, valve = np.zeros(N), np.zeros(N), [0.0] * LATE, 0.0, 0.0, 0.0, 0.0
    for t in range(N):
        pv[t] = y + 0.1 * rng.standard_normal()
        summed += (sp[t] - pv[t]) / 25.0
        op[t] = 0.8 * (sp[t] - pv[t] + summed)
        valve = stem(t, op[t], valve)
        line.append(valve)
        load = 0.97 * load + 0.04 * rng.standard_normal()
        y += (1.0 - np.exp(-1.0 / TAU)) * (1.3 * (line.pop(0) + load) - y)
    simulation = LinearSimulation(1.37, (18.8,), 4.0)
    return explain(Comparison("loop", 1.0, 40.0 + op, 50.0 + pv, 50.0 + sp, simulation=simulation))


def sticking_from(first: int) -> Stem:
    def stem(t: int, op: float, valve: float) -> float:
        return he_step(op, np.array([op, valve, 0.0]), S, J) if t >= first else op

    return stem


def loose(first: float, last: float) -> Stem:
    def stem(t: int, op: float, valve: float) -> float:
        half = 0.5 * (first + (last - first) * t / N)
        return min(max(valve, op - half), op + half)

    return stem


@pytest.mark.parametrize(("seed", "first"), [(1, 1200), (2, 1200)])
def test_a_valve_that_begins_to_stick_is_dated(seed: int, first: int) -> None:
    """Between two slips nothing tells when it began: the interval reaches from the one to the next."""
    said = asked(seed, sticking_from(first))
    assert [effect.code for effect in said.effects] == ["valve.stiction"]
    [window] = said.effects[0].windows
    assert window.start_s == pytest.approx(first, abs=40.0)
    assert window.end_s == N
    sizes = {estimate.name: estimate for estimate in said.effects[0].parameters}
    for name, truth in (("S", S), ("J", J), ("start", first)):
        assert sizes[name].low <= truth <= sizes[name].high
    assert sizes["S"].value == pytest.approx(S, rel=0.1)
    assert sizes["start"].high - sizes["start"].low < 200.0


def test_a_valve_that_begins_to_stick_another_way_is_dated() -> None:
    """Choudhury's stem slips by J on its way on, He's by S."""
    stood = np.zeros(5)

    def stem(t: int, op: float, _: float) -> float:
        if t < 700:
            choudhury_start(op, stood)
            return op
        return choudhury_step(op, stood, S, J)

    said = asked(3, stem)
    assert [effect.code for effect in said.effects] == ["valve.stiction"]
    assert said.effects[0].windows[0].start_s == pytest.approx(700, abs=40.0)
    assert said.effects[0].parameters[0].value == pytest.approx(S, rel=0.05)


def test_a_valve_that_sticks_all_along_is_not_dated() -> None:
    said = asked(1, sticking_from(0))
    assert [effect.code for effect in said.effects] == ["valve.stiction"]
    assert [(w.start_s, w.end_s) for w in said.effects[0].windows] == [(0.0, N)]


@pytest.mark.parametrize(("seed", "widths"), [(2, (0.0, 4.0)), (1, (0.5, 5.0))])
def test_a_backlash_that_grows_is_no_friction(seed: int, widths: tuple[float, float]) -> None:
    said = asked(seed, loose(*widths))
    assert [effect.code for effect in said.effects] == ["valve.deadband"]
    band, share, _ = said.effects[0].parameters
    assert band.value == pytest.approx(widths[1], rel=0.1)
    assert share.value == pytest.approx(widths[0] / widths[1], abs=0.1)


def walk() -> FloatArray:
    return np.cumsum(np.random.default_rng(0).normal(size=400))


def test_a_stem_is_where_op_is_until_it_sticks() -> None:
    op = walk()
    context = Context(experiment(2.0, op, op), Plant(1.0, 10.0, 0.0))
    stem = sets_in(op, np.array([3.0, 0.5, 300.0]), context)
    assert np.array_equal(stem[:150], op[:150])
    assert np.array_equal(stem[150:], he_stem(op[150:], 3.0, 1.5, float(op[149])))
    assert np.array_equal(sets_in(op, np.array([3.0, 0.5, 1e6]), context), op)


def test_what_op_could_not_show_before_is_not_said_to_set_in() -> None:
    assert SETS_IN.sensible is not None
    op, values = walk(), np.array([3.0, 0.5, 400.0])
    assert SETS_IN.sensible(values, Context(experiment(2.0, op, op), Plant(1.0, 10.0, 0.0)))
    rested = np.where(np.arange(400) < 190, op[190], op)
    assert not SETS_IN.sensible(values, Context(experiment(2.0, rested, op), Plant(1.0, 10.0, 0.0)))


def test_a_band_that_grows_is_as_wide_as_told_at_both_ends() -> None:
    op = np.tile([10.0, -10.0], 200)
    context = Context(experiment(1.0, op, op), Plant(1.0, 10.0, 0.0))
    gap = np.abs(grows(op, np.array([4.0, 0.5, 0.0]), context) - op)
    assert gap[1] == pytest.approx(1.0, abs=0.01)
    assert gap[-1] == pytest.approx(2.0, abs=0.01)
