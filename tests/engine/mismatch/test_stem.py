"""A valve's stem stands anywhere when a record begins: the sticking valve is named alone, with where it stood."""

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, LinearSimulation, explain
from app.engine.mismatch.fit.fitting import finish, fit_linear
from app.engine.mismatch.fit.task import Given, make_task, start_at
from app.engine.mismatch.judge.validation import OF_ONE_RECORD, simulate_again
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import additive, by_name, friction
from app.engine.mismatch.report import estimates
from app.engine.recording import FloatArray

N, K, TAU, LATE = 1200, 1.2, 18.0, 3
GIVEN = LinearSimulation(gain=1.25, time_constants_s=(17.0,), dead_time_s=2.9)
BAND, RATE = 1.6, 0.05


def play(x: float, u: float) -> float:
    return min(max(x, u - 0.5 * BAND), u + 0.5 * BAND)


def slow(x: float, u: float) -> float:
    return x + min(max(u - x, -RATE), RATE)


def loop(share: float, seed: int = 5, valve: object = play, reach: float = 0.5 * BAND) -> Comparison:
    """A PI loop at rest that gets steps of SP; its stem holds 20 units of OP, `share` of its reach above OP."""
    rng = np.random.default_rng(seed)
    sp = np.concatenate((np.zeros(80), np.repeat(rng.uniform(-6.0, 6.0, 10), 112)))
    op, pv, v = np.zeros(N), np.zeros(N), np.zeros(N)
    x, y, summed, stay = 0.0, 0.0, -share * reach, np.exp(-1.0 / TAU)
    for t in range(N):
        pv[t] = y + 0.06 * rng.standard_normal()
        summed += 0.05 * (sp[t] - pv[t])
        op[t] = summed + 0.9 * (sp[t] - pv[t])
        x = v[t] = valve(x, op[t])  # type: ignore[operator]
        y = stay * y + (1.0 - stay) * K * v[max(t - LATE, 0)]
    return Comparison("loop", 1.0, 20.0 + op, 50.0 + pv, 50.0 + sp, simulation=GIVEN)


@pytest.fixture(scope="module")
def high() -> Explanation:
    """With a second record, which adds its figures and changes nothing of the first."""
    return explain(loop(0.75), loop(-0.95, seed=8))


def names(said: Explanation) -> list[set[str]]:
    return [{effect.code, *effect.alternatives} for effect in said.effects]


def test_a_stem_high_in_its_band_needs_no_second_name(high: Explanation) -> None:
    assert len(high.effects) == 1
    assert "valve.deadband" in names(high)[0]


@pytest.mark.parametrize(("share", "simulation"), [(-0.95, GIVEN), (0.5, None)])
def test_a_stem_anywhere_in_its_band_needs_no_second_name(share: float, simulation: LinearSimulation | None) -> None:
    asked = loop(share, seed=6)
    said = explain(Comparison("loop", 1.0, asked.op, asked.pv, asked.sp, simulation=simulation))
    assert len(said.effects) == 1
    assert "valve.deadband" in names(said)[0]


def test_a_slow_stem_on_its_way_needs_no_second_name() -> None:
    said = explain(loop(1.0, valve=slow, reach=4.0))
    assert [effect.code for effect in said.effects] == ["valve.slew_limit"]
    assert said.effects[0].parameters[1].value == pytest.approx(20.0, abs=0.5)


def test_where_the_stem_stood_is_told_in_the_unit_of_op(high: Explanation) -> None:
    told = high.effects[0].parameters[-1]
    assert (told.name, told.unit) == ("stem_start", "OP")
    assert told.low <= 20.0 <= told.high
    assert told.value == pytest.approx(20.0, abs=0.15)
    assert told.high - told.low < 0.5 * BAND


def test_an_exported_model_starts_its_stem_where_it_stood(high: Explanation) -> None:
    asked = loop(0.75)
    assert simulate_again(high.model, asked.op) == pytest.approx(high.traces.explained, abs=1e-9)


def test_a_second_record_has_a_start_of_its_own(high: Explanation) -> None:
    assert high.validation is not None
    assert high.validation.explained.rmse < 0.12 < high.validation.refitted.rmse


def test_loads_and_shifts_of_one_record_are_not_carried_to_a_second() -> None:
    assert {block.code for block in additive.BLOCKS} <= set(OF_ONE_RECORD)


OP = np.concatenate((np.zeros(50), np.repeat([3.0, -3.0, 2.0, -4.0], 50)))
RECORD = experiment(1.0, 20.0 + OP, 50.0 + OP)
PLANT = Plant(K=1.0, tau=5.0, theta=0.0)


def valve(name: str, *values: float) -> FloatArray:
    """What leaves a valve that OP reaches as a deviation."""
    block = by_name(RECORD)[name]
    assert block.apply is not None
    return block.apply(RECORD.op_deviation, np.array(values), Context(RECORD, PLANT)) - RECORD.op_deviation[0]


@pytest.mark.parametrize(
    ("name", "old"),
    [
        ("valve.deadband", (2.0,)),
        ("valve.stiction/he", (2.0, 0.5)),
        ("valve.stiction/choudhury", (2.0, 0.5)),
        ("valve.slew_limit", (0.5,)),
    ],
)
def test_models_without_a_start_began_at_op(name: str, old: tuple[float, ...]) -> None:
    assert valve(name, *old) == pytest.approx(valve(name, *old, 0.0), abs=1e-12)
    assert np.all(valve(name, *old, 0.8)[:2] > valve(name, *old)[:2] + 0.2)


def test_the_stem_holds_its_start_until_op_has_crossed_the_band() -> None:
    assert valve("valve.deadband", 2.0, 0.75)[:50] == pytest.approx(0.75)
    assert valve("valve.deadband", 2.0, 0.75)[50:] == pytest.approx(valve("valve.deadband", 2.0)[50:])


def test_a_start_on_which_nothing_hangs_may_be_anywhere_in_the_band() -> None:
    op = np.concatenate(([0.0], np.repeat([3.0, -3.0, 2.0, -4.0, 3.0], 50)))
    record = experiment(1.0, 20.0 + op, 50.0 + np.random.default_rng(1).normal(size=len(op)))
    base = fit_linear(record, Given(PLANT))
    task = make_task(record, base.given, (by_name(record)["valve.deadband"],))
    found = finish(task, start_at(task, base.plant, np.array([0.5, 0.3])), base.noise)
    start = estimates(found, found.parts[0])[-1]
    assert (start.value, start.low, start.high) == pytest.approx((20.075, 19.75, 20.25), abs=1e-9)


@pytest.mark.parametrize(
    ("speed", "force", "dry"), [(0.5, -2.0, 0.3), (0.5, -0.2, 0.3), (-0.4, 1.0, 0.6), (0.0, 1.0, 0.6)]
)
def test_a_mass_that_turns_within_a_step_goes_on_from_rest(speed: float, force: float, dry: float) -> None:
    damping, mass, parts = 1.5, 2.0, 20_000
    after = friction._speed_after(speed, force, dry, damping, np.exp(-damping / mass))
    for _ in range(parts):
        held = speed == 0.0 and abs(force) <= dry
        side = np.sign(speed) if speed != 0.0 else np.sign(force)
        moved = 0.0 if held else speed + (force - damping * speed - dry * side) / mass / parts
        speed = 0.0 if speed * moved < 0.0 else moved
    assert after == pytest.approx(speed, abs=2e-4)


def test_what_has_no_parameters_tells_none() -> None:
    base = fit_linear(RECORD, Given(PLANT))
    task = make_task(RECORD, base.given, (by_name(RECORD)["process.integrating"],))
    found = finish(task, start_at(task, base.plant, np.zeros(0)), base.noise)
    assert estimates(found, found.parts[0]) == ()
