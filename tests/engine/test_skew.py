"""PV and OP that were stamped apart are found by what the controller hands on at once, and put beside each other."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.audit import audit
from app.engine.fitness import Fitness, assess
from app.engine.fitness.skew import MOST_SAMPLES, MOST_SKEW
from app.engine.recording import FloatArray, Recording
from app.engine.simulate import Signal
from tests.engine.cycling_loop import cycling, outcomes
from tests.engine.test_verdict import simulated, sticky


@pytest.fixture(scope="module")
def loop() -> Recording:
    return simulated()


def stamped_late(recording: Recording, samples: int) -> Recording:
    """With PV that many samples after OP, before it where negative; as many samples fewer."""
    first, last = max(samples, 0), recording.samples + min(samples, 0)
    return replace(recording.part(slice(first, last)), pv=recording.pv[first - samples : last - samples])


def skew_found(fitness: Fitness) -> float | None:
    return next(finding.statistic for finding in fitness.findings if finding.code == "time_skew")


@pytest.mark.parametrize("samples", [-MOST_SKEW, -3, -1, 1, 2, 5, MOST_SKEW])
def test_a_skew_is_found_and_set_right_at_the_later_stamp(loop, samples):
    recording = stamped_late(loop, samples)
    fitness = assess(recording)
    assert skew_found(fitness) == -samples
    assert outcomes(fitness)["time_skew"] == "fail"
    assert fitness.auditable
    record, kept = fitness.record, slice(abs(samples), loop.samples - abs(samples))
    for name in ("pv", "op", "sp"):
        np.testing.assert_array_equal(getattr(record, name), getattr(loop, name)[kept])
    ends_s = record.start_s + (record.samples - 1) * record.sampling_interval_s
    assert ends_s == pytest.approx(recording.time_s[-1] - recording.time_s[0])


def test_what_was_stamped_at_one_time_stays_as_it_is(loop):
    fitness = assess(loop)
    assert (skew_found(fitness), outcomes(fitness)["time_skew"]) == (0.0, "pass")
    np.testing.assert_array_equal(fitness.record.pv, loop.pv)
    assert fitness.record.start_s == 0.0


@pytest.mark.parametrize("change", [{"pv": -1e-3}, {"op": -7.0}, {"pv": 1e4, "sp": 1.0}, {"op": 1e-6, "pv": 5.0}])
def test_no_unit_and_no_sign_hides_a_skew(loop, change):
    late = stamped_late(loop, 2)
    changed = replace(late, **{name: factor * getattr(late, name) + 3.0 for name, factor in change.items()})
    assert skew_found(assess(changed)) == -2.0


def test_a_process_that_answers_at_once_is_no_skew():
    rng = np.random.default_rng(5)
    n = 1500
    load, by_hand = np.cumsum(np.convolve(rng.normal(size=n), np.ones(20) / 20, "same")), 0.3 * rng.normal(size=n)
    pv, op, total = np.zeros(n), np.zeros(n), 0.0
    for t in range(1, n):
        pv[t] = op[t - 1] + load[t]
        total += 0.3 * pv[t]
        op[t] = by_hand[t] - total
    fitness = assess(Recording("flow", np.arange(float(n)), pv, op))
    assert outcomes(fitness)["time_skew"] == "not_evaluated"
    np.testing.assert_array_equal(fitness.record.op, op)


def moved_by(op: FloatArray, seed: int = 3) -> Recording:
    """A quick process behind an OP that no controller of this loop moves: PV is there two samples later."""
    noise = 0.03 * np.random.default_rng(seed).normal(size=len(op))
    return Recording("flow", np.arange(float(len(op))), np.concatenate(([0.0, 0.0], op[:-2])) + noise, op)


@pytest.mark.parametrize("kept", [0.98, 0.0], ids=["wanders", "white"])
def test_a_pv_that_follows_what_moves_op_is_no_skew(kept):
    op = lfilter([1.0], [1.0, -kept], np.random.default_rng(2).normal(size=1500))
    assert outcomes(assess(moved_by(op)))["time_skew"] == "not_evaluated"


def test_steps_of_op_by_hand_are_no_skew():
    rng = np.random.default_rng(4)
    op = np.repeat(rng.normal(size=30), 50)
    assert outcomes(assess(moved_by(op)))["time_skew"] == "not_evaluated"


def test_steps_of_the_set_point_hide_no_skew():
    loop = simulated(sp=Signal(steps=tuple((100.0 * k, 1.0 if k % 2 else -1.0) for k in range(4, 16))))
    assert skew_found(assess(stamped_late(loop, 2))) == -2.0


def test_what_was_filled_is_told_as_it_was_recorded(loop):
    holes = np.ones(loop.samples, dtype=bool)
    holes[50:-50:25] = False
    fitness = assess(stamped_late(loop, 3).part(holes[3:]))
    told = next(finding.statistic for finding in fitness.findings if finding.code == "filled")
    assert skew_found(fitness) == -3.0
    assert fitness.filled_share == told == pytest.approx(1.0 / 25.0, abs=0.005)


def test_where_op_shows_nothing_of_pv_at_once_none_is_told():
    fitness = assess(cycling())
    assert (skew_found(fitness), outcomes(fitness)["time_skew"]) == (None, "not_evaluated")


def test_of_a_long_record_the_newest_samples_tell():
    loop = simulated(length_s=2.0 * MOST_SAMPLES)
    late = stamped_late(loop, 2)
    unlike = replace(late, pv=np.where(np.arange(late.samples) < MOST_SAMPLES // 2, 5.0 * late.op, late.pv))
    assert skew_found(assess(unlike)) == -2.0


@pytest.mark.parametrize("make", [simulated, sticky])
def test_a_skew_changes_no_verdict_and_is_told(make):
    loop = make()
    as_recorded, late = audit(loop), audit(stamped_late(loop, 3))
    assert (late.judgement.verdict, late.judgement.reliability) == (
        as_recorded.judgement.verdict,
        as_recorded.judgement.reliability,
    )
    told = next(reason.text for reason in late.judgement.reasons if reason.code == "time_skew")
    assert "3 samples (3 s) before PV shows the cause: PV is stamped late" in told
    assert "time_skew" not in [reason.code for reason in as_recorded.judgement.reasons]
