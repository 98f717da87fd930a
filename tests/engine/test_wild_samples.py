"""Values that lie alone and far from all others: dropouts and codes of a system, taken as missing and told."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.audit import audit
from app.engine.evidence import Finding
from app.engine.fitness import Fitness, assess
from tests.engine.cycling_loop import N, cycling
from tests.engine.sticking_loop import loop

LARGEST = 2147483647.0


def put(values: float | list[float], at: list[int], signal: str = "op", n: int = N) -> Fitness:
    changed = getattr(cycling(n), signal).copy()
    changed[at] = values
    return assess(cycling(n, **{signal: changed}))


def told(fitness: Fitness) -> Finding:
    (finding,) = (f for f in fitness.findings if f.code == "wild_samples")
    return finding


@pytest.mark.parametrize("signal", ["pv", "op"])
@pytest.mark.parametrize("value", [-1e3, 250.0, LARGEST, 1e30])
@pytest.mark.parametrize("at", [[100], [100, 101], [50, 300]])
def test_one_or_two_in_a_row_are_missing_and_told(signal, value, at):
    fitness = put(value, at, signal)
    assert fitness.auditable
    assert np.flatnonzero(fitness.record.filled).tolist() == at
    finding = told(fitness)
    assert (finding.outcome, finding.statistic, finding.threshold, finding.operator) == ("fail", len(at), 0.0, "<=")
    assert f"{len(at)} of {signal.upper()} ({value:.10g}" in finding.text


@pytest.mark.parametrize("value", [35.0, 70.0, 90.0])  # 1.0, 1.5 and 3.5 times the range outside of it
@pytest.mark.parametrize("at", [[100], [50, 51], [10, 200, 201]])
def test_a_jump_there_and_back_is_missing_though_it_is_not_so_far(value, at):
    fitness = put(value - 2.0 if value < 50.0 else value, at)
    assert np.flatnonzero(fitness.record.filled).tolist() == at
    assert told(fitness).statistic == len(at)


@pytest.mark.parametrize("at", [[0], [N - 1], [0, N - 1]])
def test_at_the_ends_of_a_record_they_are_left_out(at):
    fitness = put(LARGEST, at, "pv")
    assert fitness.record.samples == N - len(at)
    assert np.ptp(fitness.record.pv) < 10.0


def test_only_some_of_many_are_told():
    at = [20 * k for k in range(1, 4)] + [N - 20 * k for k in range(1, 4)]
    fitness = put([-1e3, -1e3, -1e3, 1e3, 1e3, 1e3], at)
    assert "6 of OP (-1000, -1000, -1000, 1000, 1000, ..)" in told(fitness).text


def test_a_short_record_has_them_too():
    assert told(put(-1e3, [10, 70], n=100)).statistic == 2


@pytest.mark.parametrize(
    ("values", "at"),
    [
        ([200.0] * 3, [100, 101, 102]),  # three in a row are an excursion
        ([90.0] * 3, [100, 101, 102]),
        ([62.0], [100]),  # 0.7 of the range of 10 outside of that, as noise is now and then
        ([58.0, 63.0, 68.0, 63.0, 58.0], [98, 99, 100, 101, 102]),  # there and back, but not at once
    ],
)
def test_what_lasts_or_does_not_go_so_far_stays(values, at):
    fitness = put(values, at)
    assert told(fitness).outcome == "pass"
    assert fitness.record.op[at].tolist() == values


@pytest.mark.parametrize("rounding", [0.0, 1e-15])
def test_how_far_a_signal_goes_that_mostly_stands_is_not_known(rounding):
    t = np.arange(N)
    op = np.where(t % 150 == 149, 1.0, 0.0) + 50.0 * (1.0 + rounding * (t % 2))
    assert told(assess(cycling(op=op))).outcome == "pass"


def test_op_between_two_values_has_none():
    t = np.arange(N)
    assert told(assess(cycling(op=np.where(t // 20 % 2 == 1, 100.0, 0.0)))).outcome == "pass"


@pytest.mark.parametrize("signal", ["pv", "op"])
@pytest.mark.parametrize("value", [0.0, LARGEST])
def test_a_wild_sample_changes_no_verdict(signal, value):
    good = loop(1, 4.0, 1.0).recording("FIC1")
    wild = getattr(good, signal).copy()
    wild[len(wild) // 3] = value
    first, second = audit(good).judgement, audit(replace(good, **{signal: wild})).judgement
    assert (second.verdict, second.reliability) == (first.verdict, first.reliability) == ("stiction", "reliable")
    assert second.stiction_probability == pytest.approx(first.stiction_probability, abs=0.02)
    assert "wild_samples" in {reason.code for reason in second.reasons}


def test_a_valve_that_opens_again_and_again_has_none():
    noise = np.random.default_rng(3).normal(0.0, 0.05, 2000)
    op = noise + np.where(np.arange(2000) % 250 < 2, 6.0, 0.0)
    assert told(assess(cycling(2000, op=op))).outcome == "pass"


def test_a_few_steps_of_a_coarse_transmitter_are_no_wild_samples():
    t = np.arange(N)
    pv = np.where(t // 7 % 2 == 1, 50.1, 50.0)
    pv[[100, 101]] = 50.7, 50.8
    assert told(assess(cycling(pv=pv))).outcome == "pass"


def test_two_rows_that_stand_for_hours_are_no_wild_samples():
    """An archive of changes stores a plateau by its ends."""
    good = cycling(2000)
    time_s = good.time_s.copy()
    time_s[1001:] += 3600.0 * (time_s[1] - time_s[0])
    pv = good.pv.copy()
    pv[[1000, 1001]] = 500.0
    assert told(assess(replace(good, time_s=time_s, pv=pv))).outcome == "pass"
