"""What may be compared at all: bad signals get a clear error, records that show nothing an answer without a name."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.mismatch import Comparison, LinearSimulation, explain, locate
from app.engine.mismatch.compare.comparison import given_of, mended, wild_samples
from app.engine.mismatch.fit.noise import NoiseModel, compared_samples, whiten
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.law import identify_law
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics.static_gain import exponential
from app.engine.recording import BoolArray, FloatArray
from app.errors import DataError

N, TS = 600, 2.0
GIVEN = LinearSimulation(gain=1.45, time_constants_s=(28.5,), dead_time_s=6.0)


def op() -> FloatArray:
    rng = np.random.default_rng(3)
    return 40.0 + np.repeat(rng.uniform(-6.0, 6.0, N // 50), 50) + 0.1 * rng.normal(size=N)


def pv() -> FloatArray:
    noise = 0.1 * np.random.default_rng(4).normal(size=N)
    return 50.0 + run_process(op() - 40.0, Plant(K=1.4, tau=30.0, theta=6.0), TS) + noise


def with_one(value: float) -> FloatArray:
    signal = np.full(N, 50.0)
    signal[N // 2] = value
    return signal


@pytest.mark.parametrize(
    ("changed", "code"),
    [
        ({"pv": np.full(N, 5.0)}, "signal_constant"),
        ({"pv": with_one(51.0)}, "signal_constant"),
        ({"op": np.full(N, 5.0)}, "signal_constant"),
        ({"trace": np.zeros(N - 1)}, "simulation_length"),
        ({"trace": np.full(N, np.nan)}, "simulation_not_finite"),
        ({"trace": np.full(N, 3.0)}, "simulation_constant"),
        ({"simulation": LinearSimulation(0.0)}, "model_invalid"),
        ({"simulation": LinearSimulation(np.nan)}, "model_invalid"),
        ({"simulation": LinearSimulation(1e300)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (np.inf,))}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (-30.0,), 6.0)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (30.0, np.nan), 6.0)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (1e9,))}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (30.0, 5.0, 2.0))}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (30.0,), -6.0)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (30.0,), damping=0.0)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (30.0,), damping=np.nan)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (30.0,), damping=1e3)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (), damping=0.4)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (0.0, 30.0), damping=0.4)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (1e-310, 30.0), damping=0.4)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (30.0,), integrating=True, damping=0.4)}, "model_invalid"),
        ({"simulation": LinearSimulation(1.4, (30.0,), TS * N)}, "model_invalid"),
        ({"sp": np.zeros(7)}, "signal_length"),
        ({"sp": with_one(np.nan)}, "signal_not_finite"),
        ({"measured": (("T1", with_one(np.inf)),)}, "signal_not_finite"),
        ({"known": np.zeros(N, dtype=np.bool_)}, "nothing_known"),
        ({"sampling_interval_s": 0.0}, "interval_invalid"),
        ({"pv": pv() + with_one(1e300)}, "signal_too_large"),
        ({"trace": with_one(1e200)}, "signal_too_large"),
    ],
)
def test_bad_input_gets_a_clear_error(changed: dict, code: str) -> None:
    given = {"name": "loop", "sampling_interval_s": TS, "op": op(), "pv": pv()} | changed
    for ask in (explain, locate):
        with pytest.raises(DataError) as raised:
            ask(Comparison(**given))
        assert raised.value.code == code


@pytest.mark.parametrize(
    ("damping", "taus", "told"),
    [
        (None, (1e-310,), ()),
        (None, (30.0, 1e-310), (30.0,)),
        (0.4, (30.0, 1e-310), (30.0,)),
        (1.7, (30.0, 1e-310), (30.0,)),
    ],
)
def test_a_lag_too_short_for_a_number_is_none(
    damping: float | None, taus: tuple[float, ...], told: tuple[float, ...]
) -> None:
    record, model = experiment(TS, op(), pv()), LinearSimulation(1.4, taus, 6.0, damping=damping)
    assert given_of(model, record) == given_of(replace(model, time_constants_s=told), record)


def every(step: int) -> BoolArray:
    known = np.zeros(N, dtype=np.bool_)
    known[::step] = True
    return known


@pytest.mark.parametrize("known", [every(7), np.arange(N) < 60])
def test_too_few_known_samples_are_inconclusive(known: BoolArray) -> None:
    comparison = Comparison("gaps", TS, op(), pv(), known=known, simulation=GIVEN)
    answer = explain(comparison)
    assert answer.verdict == "inconclusive"
    assert answer.evidence[0].code == "too_few_data"
    assert locate(comparison).evidence[0].code == "too_few_data"


@pytest.mark.parametrize("step", [2, 4, 5, 9])
def test_samples_are_compared_where_there_is_an_innovation(step: int) -> None:
    e = whiten(np.random.default_rng(1).normal(size=N), every(step), NoiseModel(deviation=1.0))
    assert np.array_equal(compared_samples(every(step))[step:], e[step:] != 0.0)


def test_a_simulation_that_is_the_recording_lacks_nothing() -> None:
    answer = explain(Comparison("same", TS, op(), pv(), trace=pv()))
    assert answer.verdict == "consistent"
    assert answer.effects == ()


def test_a_valve_far_out_of_its_span_stays_finite() -> None:
    record = experiment(TS, op() + with_one(3000.0), pv())
    assert np.ptp(record.op) > 100.0 * record.op_span
    context = Context(record, Plant(K=1.4, tau=30.0, theta=6.0))
    with np.errstate(over="raise"):
        assert np.all(np.isfinite(exponential(record.op_deviation, np.array([6.0]), context)))


@pytest.mark.parametrize(
    ("simulation", "shown"),
    [
        (LinearSimulation(2.8, (30.0,), 6.0), {"K": 1.4}),
        (LinearSimulation(-1.4, (30.0,), 6.0), {"K": 1.4}),
        (LinearSimulation(140.0, (30.0,), 6.0), {"K": 1.4}),
        (LinearSimulation(0.5, (12.0,), 24.0), {"K": 1.4, "tau": 30.0, "theta": 6.0}),
    ],
)
def test_parameters_far_off_are_reported_and_are_no_missing_physics(
    simulation: LinearSimulation, shown: dict[str, float]
) -> None:
    answer = explain(Comparison("off", TS, op(), pv(), simulation=simulation))
    assert answer.verdict == "consistent"
    assert answer.evidence[0].code == "parameters_off"
    found = {estimate.name: estimate.value for estimate in answer.refit}
    assert {name: found[name] for name in shown} == pytest.approx(shown, rel=0.1)


def test_an_effect_is_named_beside_a_simulation_that_is_far_off() -> None:
    stopped = np.minimum(op() - 40.0, 2.5)
    noise = 0.1 * np.random.default_rng(4).normal(size=N)
    limited = 50.0 + run_process(stopped, Plant(K=1.4, tau=30.0, theta=6.0), TS) + noise
    answer = explain(Comparison("off", TS, op(), limited, simulation=LinearSimulation(0.7, (30.0,), 6.0)))
    assert [effect.code for effect in answer.effects] == ["valve.saturation"]
    assert answer.evidence[0].code == "parameters_off"


def test_a_first_answer_says_that_parameters_are_off() -> None:
    found = locate(Comparison("off", TS, op(), pv(), simulation=LinearSimulation(0.5, (30.0,), 6.0)))
    assert found.block is None
    assert found.evidence[0].code == "parameters_off"


def test_an_op_of_another_loop_explains_nothing_of_a_pv() -> None:
    stranger = 30.0 + np.repeat(np.random.default_rng(11).uniform(-4.0, 4.0, N // 75), 75)
    steps = 50.0 + np.repeat(np.random.default_rng(12).uniform(-5.0, 5.0, 4), N // 4)
    noise = 0.2 * np.random.default_rng(13).normal(size=N)
    answer = explain(Comparison("mixed up", TS, stranger, steps + noise, simulation=GIVEN))
    assert answer.verdict == "inconclusive"
    assert answer.evidence[0].code == "op_moves_nothing"
    assert "one loop" in answer.evidence[0].text


def test_a_set_point_that_jumps_explains_op_beside_the_pv_of_any_loop() -> None:
    rng = np.random.default_rng(6)
    sp = 50.0 + np.repeat(rng.uniform(-5.0, 5.0, 12), N // 12)
    own, other = (lfilter([0.05], [1.0, -0.95], sp - 50.0) + 50.0 + 0.1 * rng.normal(size=N) for _ in range(2))
    other = np.roll(other, 170)
    op = 40.0 + 2.0 * (sp - own) + 0.1 * np.cumsum(sp - own) + 0.05 * rng.normal(size=N)
    assert identify_law(sp, other, op).explained > 0.8
    assert experiment(TS, op, own, sp).op_follows_pv
    assert not experiment(TS, op, other, sp).op_follows_pv


@pytest.mark.parametrize("seed", [3, 9])
def test_a_stem_that_walks_towards_any_op_tells_nothing_of_this_one(seed: int) -> None:
    """A stem may be given any slow course that PV has: it starts off OP and moves at a rate of its own."""
    rng = np.random.default_rng(seed)
    wandering = lfilter([1.0], [1.0, -0.95], rng.normal(size=N))
    slow = np.interp(np.arange(N), [0, 150, N - 1], [-5.0, 3.0, 5.0]) + 0.2 * rng.normal(size=N)
    answer = explain(Comparison("mixed up", TS, 30.0 + wandering, 50.0 + slow, simulation=GIVEN))
    assert answer.verdict == "inconclusive"
    assert "op_moves_nothing" in {reason.code for reason in answer.evidence}


def test_a_trace_that_does_not_answer_op_explains_nothing() -> None:
    trace = 50.0 + np.random.default_rng(14).normal(size=N)
    answer = explain(Comparison("another", TS, op(), pv(), trace=trace))
    assert answer.verdict == "inconclusive"
    assert answer.evidence[0].code == "simulation_unrelated"


def spoiled(bad: float) -> Comparison:
    signal = pv()
    signal[[200, 201, 417]] = bad
    return Comparison("bad", TS, op(), signal, simulation=GIVEN)


@pytest.mark.parametrize("bad", [-9999.0, 32767.0, 1e37])
def test_of_a_bad_value_of_pv_nothing_is_left(bad: float) -> None:
    left, other = mended(spoiled(bad)), mended(spoiled(-9999.0))
    assert np.array_equal(left.pv, other.pv)
    assert np.array_equal(np.flatnonzero(~left.known), [200, 201, 417])
    assert np.array_equal(left.known, other.known)
    assert [note.code for note in left.notes] == ["wild_samples"]


def test_a_bad_value_of_pv_is_left_out_and_said() -> None:
    answer = explain(spoiled(-9999.0))
    assert answer.verdict == "consistent"
    assert answer.evidence[0].code == "wild_samples"
    assert "3 samples" in answer.evidence[0].text


@pytest.mark.parametrize(("early", "said"), [(30, "early and was compared 30"), (-30, "late and was compared 30")])
def test_a_trace_out_of_step_is_said_and_accuses_nothing(early: int, said: str) -> None:
    """An early one answers OP before OP moves; a late one begins with what answers no OP of the record."""
    trace = 50.0 + run_process(op() - 40.0, Plant(K=1.45, tau=28.5, theta=6.0), TS)
    at = np.arange(N)
    answer = explain(Comparison("shifted", TS, op(), pv(), trace=np.interp(at + early, at, trace)))
    assert answer.verdict == "consistent"
    assert answer.evidence[0].code == "simulation_shifted"
    assert answer.evidence[0].text.startswith(f"the simulation is {said} samples")
    assert answer.fit.refitted.rmse < 0.12
    theta = next(estimate.value for estimate in answer.refit if estimate.name == "theta")
    assert theta == pytest.approx(6.0, abs=TS)


def test_another_unit_and_other_times_are_both_said() -> None:
    trace = 1000.0 * (50.0 + run_process(op() - 40.0, Plant(K=1.45, tau=90.0, theta=6.0), TS))
    answer = explain(Comparison("unit", TS, op(), pv(), trace=trace))
    off = [reason.text for reason in answer.evidence if reason.code == "parameters_off"]
    assert answer.verdict == "consistent"
    assert len(off) == 2
    assert "another unit" in off[0]
    assert "tau 90" in off[1]


def test_a_stretch_or_a_pv_that_rests_has_no_bad_value() -> None:
    jumped = pv() + 2000.0 * (np.arange(N) > N - 5)
    assert wild_samples(jumped).sum() == 4
    assert not wild_samples(pv() + 2000.0 * (np.arange(N) > N - 50)).any()
    assert not wild_samples(np.where(np.arange(N) > N - 4, 51.0, 50.0)).any()


def test_a_trace_in_another_unit_accuses_nothing() -> None:
    trace = 0.01 * (50.0 + run_process(op() - 40.0, Plant(K=1.45, tau=28.5, theta=6.0), TS))
    answer = explain(Comparison("unit", TS, op(), pv(), trace=trace))
    assert answer.verdict == "consistent"
    assert answer.evidence[0].code == "parameters_off"


def test_a_limit_that_op_is_driven_far_beyond_is_no_other_unit() -> None:
    """Where PV follows no further the controller winds up, and the simulation goes far: over a stretch they agree."""
    driven = np.concatenate((np.repeat([38.0, 43.0, 36.0, 41.0], 50), 40.0 + 0.6 * np.arange(N - 200)))
    noise = 0.1 * np.random.default_rng(4).normal(size=N)
    limited = 50.0 + run_process(np.minimum(driven, 44.0) - 40.0, Plant(K=1.4, tau=30.0, theta=6.0), TS) + noise
    answer = explain(Comparison("limit", TS, driven, limited, simulation=GIVEN))
    assert answer.effects[0].code in ("valve.saturation", "process.overflow")
    assert "parameters_off" not in {reason.code for reason in answer.evidence}


def test_a_rounded_trace_accuses_nothing() -> None:
    level = 1.0
    trace = 50.0 + run_process(op() - 40.0, Plant(K=1.45, tau=28.5, theta=6.0), TS)
    answer = explain(Comparison("rounded", TS, op(), pv(), trace=level * np.round(trace / level)))
    assert answer.verdict == "consistent"
    assert answer.fit.explained.rmse < 0.15


def test_a_model_is_laid_at_the_level_of_pv() -> None:
    """A model says how PV moves, not where it stands: odd first samples do not count against it."""
    odd = pv()
    odd[:3] += 3.0
    given = LinearSimulation(gain=1.4, time_constants_s=(30.0,), dead_time_s=6.0)
    answer = explain(Comparison("level", TS, op(), odd, simulation=given))
    assert answer.fit.given.rmse < 0.15


def test_an_op_whose_squares_are_no_numbers_is_constant() -> None:
    with pytest.raises(DataError) as refused:
        explain(Comparison("small", TS, 1e-200 * op(), pv()))
    assert refused.value.code == "signal_constant"
    assert explain(Comparison("small", TS, 1e-40 * op()[:200], pv()[:200])).fit.refitted.rmse > 0.0
