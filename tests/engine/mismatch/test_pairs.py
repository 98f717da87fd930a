"""Two effects at once: looked for together, paid for what slow noise hid of the second, and not dropped for one stretch
over which a free run goes astray.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, explain
from app.engine.mismatch.compete.competition import Contender, contenders, survey
from app.engine.mismatch.compete.looking_ahead import looked_ahead
from app.engine.mismatch.compete.naming import believed
from app.engine.mismatch.compete.pairing import Candidate, Couple, alone_as, couples, joint_scores, placed, reordered
from app.engine.mismatch.compete.pairs import Pair, Places, paying_alone
from app.engine.mismatch.compete.searching import Begun, foremost, searched
from app.engine.mismatch.compete.selection import Selection, in_place_of
from app.engine.mismatch.compete.worth import gain_under, hidden_gain, makes_sense, pays_beside, worth
from app.engine.mismatch.fit.fitting import Fit, finish, fit, fit_linear
from app.engine.mismatch.fit.noise import NoiseModel
from app.engine.mismatch.fit.scan import Start, ground
from app.engine.mismatch.fit.task import Given, make_task, start_at
from app.engine.mismatch.judge.holdout import FreeRuns, mostly_worse, stretches
from app.engine.mismatch.loop.block import Block, Context, Part
from app.engine.mismatch.loop.chain import simulate
from app.engine.mismatch.loop.experiment import Experiment, experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import additive, friction, generic, library, valve_deadband, valve_slew_limit
from app.engine.recording import FloatArray
from tests.proof.cases import make_case

N, TS = 1000, 2.0
PLANT = Plant(K=1.4, tau=30.0, theta=6.0)
DEADBAND, RAMP = valve_deadband.BLOCKS[0], next(b for b in additive.BLOCKS if b.code == "sensor.drift")


def op_moves() -> FloatArray:
    rng = np.random.default_rng(3)
    return np.repeat(rng.uniform(-6.0, 6.0, N // 50), 50) + np.cumsum(rng.normal(size=N)) * 0.03


def recorded(parts: tuple[Part, ...], noise: float = 0.1) -> Experiment:
    op = 40.0 + op_moves()
    plain = experiment(TS, op, 50.0 + op_moves())
    pv = 50.0 + simulate(plain, PLANT, parts) + noise * np.random.default_rng(5).normal(size=N)
    return experiment(TS, op, pv)


def backlash() -> Part:
    return Part(DEADBAND, np.array([2.0, 0.0]))


def drift() -> Part:
    return Part(RAMP, np.array([600.0, 800.0, 3.0]))


@pytest.fixture(scope="module")
def both() -> Fit:
    """The linear refit of a record with a deadband and a drift."""
    return fit_linear(recorded((backlash(), drift())), Given(PLANT))


def fitted(base: Fit, parts: tuple[Part, ...]) -> Fit:
    task = make_task(base.record, base.given, tuple(part.block for part in parts))
    return fit(task, start_at(task, base.plant, np.concatenate([part.values for part in parts])), None, 2, 6)


def test_two_differences_are_scored_together(both: Fit) -> None:
    under = ground(both, both.noise)
    rows = np.eye(3, len(under.rows)) * np.sqrt(under.energy / 4.0)
    under = type(under)(**{**vars(under), "rows": -(rows[0] + rows[1]), "energy": under.energy / 2.0})
    scores = joint_scores([Candidate(backlash(), row) for row in rows], under)
    assert np.argmax(scores) == 1
    assert scores[0, 2] == pytest.approx(0.5 * under.count * np.log(2.0) - 2.0 * DEADBAND.penalty)
    assert np.all(np.isneginf(scores[np.tril_indices(3)]))
    wild = np.vstack((rows, 1e100 * rows[:1], np.nan * rows[:1]))  # what a simulation that runs away moves
    beside = joint_scores([Candidate(backlash(), row) for row in wild], under)
    np.testing.assert_array_equal(beside[:3, :3], scores)
    assert np.all(np.isneginf(beside[:, 3:]))


def test_the_couple_that_was_put_in_is_looked_at_unless_one_of_it_is_to_be_taken(both: Fit) -> None:
    put_in = {"valve.deadband", "sensor.drift"}
    blocks = tuple(block for block in library(both.record) if block.code in {*put_in, "valve.slew_limit"})
    surveyed = survey(both, blocks)

    def looked_at(apart: tuple[frozenset[str], ...]) -> list[set[str]]:
        return [{part.block.code for part in couple.parts} for couple in couples(both, surveyed, apart)]

    assert put_in in looked_at(())
    assert put_in not in looked_at((frozenset(put_in),))
    assert looked_at((frozenset(put_in),))


def test_the_foremost_is_looked_for_beside_what_did_not_compete(both: Fit) -> None:
    """The drift is a partner in a couple alone; beside it the deadband explains more than by itself."""
    blocks = tuple(block for block in library(both.record) if block.code in {"valve.deadband", "sensor.drift"})
    surveyed = survey(both, blocks)
    alone = fitted(both, (backlash(),))
    first = Contender(alone, both)
    promising = (Couple((backlash(), drift()), 0.0),)
    found = looked_ahead(both, surveyed, promising, (first,), ())
    assert [{part.block.code for part in couple.parts} for couple in found] == [{"valve.deadband", "sensor.drift"}]
    assert found[0].likelihood >= fitted(both, (backlash(), drift())).likelihood - 1.0
    assert looked_ahead(both, surveyed, (), (first,), ()) == ()
    assert looked_ahead(both, surveyed, promising, (), ()) == ()


def test_the_order_of_a_couple_changes_nothing_but_its_order(both: Fit) -> None:
    one = fitted(both, (backlash(), drift()))
    other = reordered(one, (1, 0))
    assert [part.block.code for part in other.parts] == ["sensor.drift", "valve.deadband"]
    assert other.likelihood == pytest.approx(one.likelihood)
    np.testing.assert_allclose(other.simulated, one.simulated)


@pytest.mark.parametrize(("behind", "pairs"), [(5.0, 1), (3.0, 0)])
def test_a_pair_is_compared_with_what_says_nothing_by_score(both: Fit, behind: float, pairs: int) -> None:
    """What has no name explains more here than the pair, and pays for it: it has to be 4 nats behind by score."""
    one, two = fitted(both, (backlash(),)), fitted(both, (backlash(), drift()))
    first = Contender(one, both)
    second = Contender(two, one)
    unnamed = generic.BLOCKS[0]
    said = two.score + unnamed.penalty - behind
    nothing = replace(one, parts=(Part(unnamed, np.zeros(0)),), likelihood=said)
    assert nothing.likelihood > two.likelihood
    alone = (Contender(nothing, both), first)
    assert len(Places(first, (second,)).pairs(alone)) == pairs


def slow_part(noise: NoiseModel) -> float:
    """How far constant innovations of one deviation would carry PV: a pole beside a zero carries nothing."""
    return noise.deviation * float(np.prod(1.0 - np.array(noise.zeros)) / np.prod(1.0 - np.array(noise.poles)))


def test_what_slow_noise_hid_counts_half(both: Fit) -> None:
    first = fitted(both, (drift(),))
    second = fitted(both, (drift(), backlash()))
    contender = Contender(second, first)
    under_both = gain_under(second, first)
    assert slow_part(second.noise) < 0.1 * slow_part(first.noise)
    assert under_both > contender.gain
    assert hidden_gain(contender) == pytest.approx(0.5 * (under_both - contender.gain))


def test_time_alone_is_paid_for_nothing_that_slow_noise_hid(both: Fit) -> None:
    first, second = fitted(both, (backlash(),)), fitted(both, (backlash(), drift()))
    assert gain_under(second, first) > second.likelihood - first.likelihood
    assert hidden_gain(Contender(second, first)) == 0.0


def gaining(gain: float, found: Fit, over: Fit) -> Contender:
    """A contender that gains so much (nat) over such a fit."""
    return Contender(found, replace(over, likelihood=found.likelihood - gain))


def test_a_small_second_must_run_nearer(both: Fit) -> None:
    """A hundredth nearer is not much nearer; beside a first that gained as much it need not be."""
    first = fitted(both, (drift(),))
    known, pv = fitted(both, (drift(), backlash())), first.record.pv_deviation
    second = replace(known, simulated=pv - 0.99 * first.residual)
    contender = gaining(60.0, second, first)
    assert pays_beside(contender, gaining(300.0, first, both))
    assert not pays_beside(contender, gaining(500.0, first, both))
    close = replace(second, simulated=pv - 0.7 * first.residual)
    assert pays_beside(replace(contender, fit=close), gaining(500.0, first, both))


def test_nothing_is_hidden_of_what_hardly_gains_or_runs_no_nearer(both: Fit) -> None:
    first, second = fitted(both, (drift(),)), fitted(both, (drift(), backlash()))
    assert hidden_gain(gaining(0.5 * DEADBAND.penalty, second, first)) == 0.0
    assert hidden_gain(gaining(100.0, second, second)) == 0.0


def test_a_fault_that_leaves_few_samples_leaves_some_of_them_to_fit() -> None:
    usable = np.zeros(N, dtype=np.bool_)
    usable[N - 40 :] = True
    offered = stretches(usable)
    assert {int(held.sum()) for held in offered} <= {11, 12, 13}
    assert not any(np.any(held & ~usable) for held in offered)
    whole = stretches(np.ones(10, dtype=np.bool_))
    assert np.flatnonzero(whole[0]).tolist() == [7, 8, 9]


@pytest.mark.parametrize(("worse", "refused"), [(1, False), (2, False), (3, True), (5, True)])
def test_one_stretch_alone_refuses_no_name(both: Fit, worse: int, refused: bool) -> None:
    pv, usable = np.zeros(N), np.ones(N, dtype=np.bool_)
    runs = [
        FreeRuns(np.ones(N), np.full(N, 3.0 if k < worse else 0.5), held, 0.0, both, ())
        for k, held in enumerate(stretches(usable))
    ]
    assert mostly_worse(pv, runs) is refused


@pytest.fixture
def blind() -> Callable[[int, tuple[str, str]], Explanation]:
    def asked(seed: int, effects: tuple[str, str]) -> Explanation:
        case = make_case(seed, effects, foreign=True)
        return explain(Comparison(case.name, case.ts, case.op, case.pv, case.sp, case.measured, trace=case.trace))

    return asked


@pytest.mark.parametrize(
    ("seed", "effects"),
    [
        (4_100_043, ("valve.deadband", "disturbance.oscillation")),
        (4_100_025, ("process.extra_lag", "disturbance.ramp")),
        (20_100_001, ("process.friction", "disturbance.oscillation")),
        (230_200_052, ("disturbance.oscillation", "process.gain_drift")),
    ],
)
def test_both_are_named(
    blind: Callable[[int, tuple[str, str]], Explanation], seed: int, effects: tuple[str, str]
) -> None:
    """A deadband whose likelihood an oscillation's noise hid; a lag and a ramp of which neither leads to the other
    alone; a friction that hardly pays alone, and beside which an oscillation explains twice as much; a gain that
    drifts, found beside an oscillation without harmonics, which was found beside a gain that steps.
    """
    assert {effect.code for effect in blind(seed, effects).effects} == set(effects)


@pytest.mark.parametrize(("lasts", "sensible"), [(1.0, False), (12.0, True)])
def test_what_stands_beside_a_second_still_is_what_its_code_says(both: Fit, lasts: float, sensible: bool) -> None:
    """A pulse that has become a spike, which is none, beside a deadband that is worth much."""
    pulse = next(block for block in additive.BLOCKS if block.name == "sensor.step/pulse")
    beside = finish(*placed(both, (Part(pulse, np.array([600.0, 600.0 + lasts * TS, 0.1])),)), both.noise)
    second = finish(*placed(beside, (*beside.parts, backlash())), both.noise)
    assert makes_sense(Contender(second, beside)) is sensible


def test_a_drift_is_where_it_was_put(both: Fit) -> None:
    found = fitted(both, (backlash(), drift()))
    parameters = DEADBAND.parameters(Context(found.record, found.plant))
    assert len(found.parts[0].values) == len(parameters)
    assert found.parts[0].values[0] == pytest.approx(2.0, rel=0.1)
    assert found.parts[1].values[2] == pytest.approx(3.0, rel=0.1)


def begun(base: Fit, part: Part) -> Fit:
    """A part beside the linear refit, nothing fitted."""
    task = make_task(base.record, base.given, (part.block,))
    return finish(task, start_at(task, base.plant, part.values), base.noise)


def against(base: Fit, first: Fit) -> Contender | None:
    """What is said instead of a deadband that stands like `first` with a drift beside it; None: both."""
    found = fitted(base, (backlash(), drift()))
    # As beside what stands for the whole process: the numbers of its linear plant mean nothing.
    found = replace(found, plant=found.plant.changed(tau=400.0, theta=30.0))
    alone = Contender(first, base)
    second = Contender(found, first)
    return paying_alone(Pair(alone, second, 1000.0, ()), base, (alone,), (DEADBAND,))


def test_a_second_does_not_pay_beside_a_first_that_stands_poorly() -> None:
    base = fit_linear(recorded((backlash(),)), Given(PLANT))
    poor = begun(base, Part(DEADBAND, np.array([1.2, 0.0])))
    assert fitted(base, (backlash(), drift())).likelihood > poor.likelihood + 100.0
    said = against(base, poor)
    assert said is not None
    assert said.block is DEADBAND
    assert said.fit.parts[0].values[0] == pytest.approx(2.0, rel=0.02)


def test_two_that_pay_beside_each_other_stay(both: Fit) -> None:
    assert against(both, begun(both, Part(DEADBAND, np.array([1.2, 0.0])))) is None


def test_a_band_is_looked_for_again_where_its_first_scan_passed_over_it() -> None:
    base = fit_linear(recorded((backlash(),), 0.01), Given(PLANT))
    poor = begun(base, Part(DEADBAND, np.array([1.7, 0.0])))
    again = searched(Contender(poor, base), (DEADBAND,))
    assert again.gain == pytest.approx(again.fit.likelihood - base.likelihood)
    assert again.fit.parts[0].values[0] == pytest.approx(2.0, rel=0.01)


def kept_of(form: Block, context: Context, others: FloatArray) -> list[int]:
    """Which starts of one size are kept that differ in the second number alone, best first; others: (M,) its values."""
    size = form.starts(context, np.zeros(N))[0, 0]
    points = [Begun(form, Start(np.array([size, other]), -float(k))) for k, other in enumerate(others)]
    return [round(-point.start.gain) for point in foremost(points, context)]


@pytest.mark.parametrize("unit", [1e-3, 0.01, 1.0, 50.0])
def test_the_neighbours_of_a_start_depend_on_no_unit_of_op(unit: float) -> None:
    op = unit * op_moves()
    context = Context(experiment(TS, op, op_moves()), PLANT.changed(K=PLANT.K / unit))
    reach = context.record.op_range * np.array([0.0, 0.1, 0.5, 0.6, -0.5])
    assert kept_of(valve_slew_limit.BLOCKS[0], context, reach) == [0, 2, 4]


@pytest.mark.parametrize("unit", [1 / 3600.0, 1.0, 1e3])
def test_the_neighbours_of_a_start_depend_on_no_unit_of_time(unit: float) -> None:
    """Times are compared by their logarithms."""
    plant = PLANT.changed(tau=unit * PLANT.tau, theta=unit * PLANT.theta)
    context = Context(experiment(unit * TS, op_moves(), op_moves()), plant)
    before_the_lag = next(form for form in friction.BLOCKS if form.form == "before-the-lag")
    assert kept_of(before_the_lag, context, unit * np.array([0.5, 0.6, 5.0, 6.0, 60.0])) == [0, 2, 4]


def said_for(best: Contender, alone: Contender) -> Contender:
    """Which effect is named where a pair is refused, `best` paid first and `alone` is the better of the pair."""
    single = Selection(best.fit, (believed(best, (best,)),), (best,))
    return in_place_of(single, alone).effects[0].contender


@pytest.fixture(scope="module")
def deadband() -> Contender:
    base = fit_linear(recorded((backlash(),)), Given(PLANT))
    found = fitted(base, (backlash(),))
    return Contender(found, base)


def test_one_of_a_refused_pair_is_named_alone_where_it_is_worth_as_much_as_the_best(deadband: Contender) -> None:
    better, equal = replace(deadband), replace(deadband)
    best = gaining(deadband.gain - 1.0, deadband.fit, deadband.over)
    assert worth(best) < worth(better)
    assert said_for(best, better) is better
    assert said_for(deadband, equal) is equal


def test_the_best_effect_stays_where_one_of_a_refused_pair_is_worth_less(deadband: Contender) -> None:
    """By less than what another name would have to be better by."""
    less = gaining(deadband.gain - 1.0, deadband.fit, deadband.over)
    assert 0.0 < worth(less) < worth(deadband)
    assert said_for(deadband, less) is deadband


def test_the_best_effect_stays_where_one_of_a_refused_pair_makes_no_sense(deadband: Contender) -> None:
    block = replace(DEADBAND, sensible=lambda *_: False)
    task = make_task(deadband.over.record, deadband.over.given, (block,))
    senseless = Contender(finish(task, deadband.fit.x, deadband.fit.noise), deadband.over)
    assert worth(senseless) == -np.inf
    assert said_for(deadband, senseless) is deadband


def test_an_overflow_found_beside_a_lag_is_carried_beside_an_integrator_and_back() -> None:
    """It has the integrator's balance as a second number there: behind a stem our own loop may integrate where the one
    found from OP does not.
    """
    u = op_moves()
    record = experiment(TS, u, 50.0 + np.minimum(simulate(experiment(TS, u, u), PLANT), 4.0) + 0.01 * u[::-1])
    lag = fit_linear(record, Given(PLANT))
    tank = fit_linear(record, Given(Plant(K=0.05, tau=1.0, theta=6.0, leak=0.0), integrating=True))
    overflow = next(block for block in library(record) if block.name == "process.overflow/high")
    level = np.array([3.5])
    beside = contenders(tank, (overflow,), (Part(overflow, level),))
    assert [len(contender.fit.parts[-1].values) for contender in beside] == [2]
    alone = alone_as(Part(overflow, np.append(level, 0.1)), lag, lag.plant)
    assert len(alone.fit.parts[-1].values) == 1
