"""What a clock drives keeps time; a valve that sticks does not, and the verdict knows the difference."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.audit import audit
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import UniformRecord
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, Wave, first_order, simulate_loop
from app.engine.verdict import doubts as doubting
from app.engine.verdict.config import VerdictConfig
from app.engine.verdict.timekeeping import FEWEST_CYCLES, Timekeeping, timekeeping

PER_CYCLE, CYCLES = 40, 50


def record(pv, op, interval_s=1.0):
    return UniformRecord(interval_s, pv, op, None, np.zeros(len(pv), dtype=bool))


def swing(per_cycle=float(PER_CYCLE), cycles=float(CYCLES)):
    return Oscillation(per_cycle, 5.0, 0.9, per_cycle, cycles, "pv", 0.0)


def triangle(phase):
    return 2.0 * np.abs(2.0 * (phase % 1.0) - 1.0) - 1.0


def walking(jitter, seed, cycles=CYCLES):
    """A phase, in cycles, whose cycles differ in length by this share, from one to the next at random."""
    lengths = 1.0 / (1.0 + jitter * np.random.default_rng(seed).standard_normal(cycles + 10))
    return np.cumsum(np.repeat(lengths, PER_CYCLE))[: cycles * PER_CYCLE] / PER_CYCLE


def jitter_of(phase, noise=0.0, seed=1):
    rng = np.random.default_rng(seed)
    pv, op = (triangle(phase + shift) + noise * rng.standard_normal(len(phase)) for shift in (0.0, 0.25))
    return timekeeping(record(pv, op), swing()).jitter


def test_a_clock_under_noise_keeps_time():
    assert jitter_of(np.arange(CYCLES * PER_CYCLE) / PER_CYCLE) < 1e-3
    assert jitter_of(np.arange(CYCLES * PER_CYCLE) / PER_CYCLE, noise=0.3) < 0.01


def test_a_period_that_is_known_by_a_hundredth_only_is_no_jitter():
    assert jitter_of(1.01 * np.arange(CYCLES * PER_CYCLE) / PER_CYCLE) < 1e-3


@pytest.mark.parametrize("jitter", [0.02, 0.05, 0.1])
def test_cycles_that_differ_are_measured(jitter):
    found = [jitter_of(walking(jitter, seed)) for seed in range(40)]
    assert np.median(found) == pytest.approx(jitter, rel=0.3)


def test_unit_offset_sign_and_time_unit_make_no_difference():
    phase = walking(0.05, 3)
    plain = record(triangle(phase), triangle(phase + 0.25))
    turned = record(-1e3 * plain.pv + 7.0, 1e-6 * plain.op, interval_s=60.0)
    one, other = timekeeping(turned, swing()), timekeeping(plain, swing())
    assert (one.jitter, one.unlike) == pytest.approx((other.jitter, other.unlike), rel=1e-9)


def test_the_less_even_signal_counts():
    even, uneven = triangle(np.arange(2000) / PER_CYCLE), triangle(walking(0.1, 5))
    assert timekeeping(record(even, uneven), swing()) == timekeeping(record(uneven, even), swing())
    assert timekeeping(record(even, uneven), swing()).jitter > 0.03


def test_what_differs_from_cycle_to_cycle_is_measured():
    phase, noise = np.arange(2000) / PER_CYCLE, np.random.default_rng(4).standard_normal((2, 2000))
    clean = np.stack([triangle(phase), triangle(phase + 0.25)])
    assert timekeeping(record(*clean), swing()).unlike < 0.03
    swings = np.std(clean[0])
    assert timekeeping(record(*(clean + 0.5 * swings * noise)), swing()).unlike == pytest.approx(
        0.5 / np.hypot(1.0, 0.5), rel=0.05
    )


def test_an_edge_is_no_difference_between_cycles_and_neither_is_a_period_known_by_a_hundredth():
    square = np.where(np.arange(2000) % PER_CYCLE < PER_CYCLE // 2, 1.0, -1.0)
    assert timekeeping(record(square, square), swing()).unlike < 0.03
    slower = triangle(1.01 * np.arange(2000) / PER_CYCLE)
    assert timekeeping(record(slower, slower), swing()).unlike < 0.05


def test_few_cycles_no_period_and_a_signal_that_stands_are_not_evaluated():
    few = np.arange((FEWEST_CYCLES + 2) * PER_CYCLE - 1) / PER_CYCLE
    assert timekeeping(record(triangle(few), triangle(few)), swing()) is None
    whole = np.arange(CYCLES * PER_CYCLE) / PER_CYCLE
    pair = record(triangle(whole), triangle(whole))
    assert timekeeping(pair, replace(swing(), samples_per_cycle=None)) is None
    assert timekeeping(replace(pair, op=np.full(len(whole), 3.0)), swing()) is None
    assert timekeeping(replace(pair, pv=np.full(len(whole), 3.0)), swing()) is None


def test_op_is_not_looked_at_where_pv_is_uneven_enough():
    whole = np.arange(20 * PER_CYCLE) / PER_CYCLE
    pair = record(triangle(whole), np.full(len(whole), 3.0))
    alone = timekeeping(replace(pair, op=pair.pv), swing())
    assert timekeeping(pair, swing(), uneven=alone.jitter) == alone
    assert timekeeping(pair, swing(), uneven=alone.jitter + 1e-6) is None


def test_as_many_cycles_as_are_needed_are_evaluated():
    enough = np.arange((FEWEST_CYCLES + 2) * PER_CYCLE) / PER_CYCLE
    assert timekeeping(record(triangle(enough), triangle(enough)), swing()) is not None


@pytest.mark.parametrize(
    ("jitter", "unlike", "doubted"),
    [
        (0.0149, 1.0, True),
        (0.015, 1.0, False),
        (0.0034, 0.1, True),
        (0.0036, 0.1, False),
        (0.0149, 0.1, False),
        (0.016, 1.0, False),
    ],
)
def test_a_swing_keeps_time_by_both_yardsticks_or_not_at_all(monkeypatch, jitter, unlike, doubted):
    monkeypatch.setattr(doubting, "timekeeping", lambda *_: Timekeeping(jitter, unlike))
    config = VerdictConfig(min_jitter=0.015, min_jitter_of_unlike=0.035)
    doubts = doubting._keeps_time(record(np.zeros(3), np.zeros(3)), swing(), config)
    assert [doubt.code for doubt in doubts] == ["keeps_time"] * doubted
    assert [doubt.measured.passed for doubt in doubts] == [False] * doubted


def test_a_swing_that_could_not_be_measured_is_no_doubt(monkeypatch):
    monkeypatch.setattr(doubting, "timekeeping", lambda *_: None)
    assert doubting._keeps_time(record(np.zeros(3), np.zeros(3)), swing(), VerdictConfig()) == []


def loop(seed, **changes):
    spec = LoopSpec(
        plant=first_order(1.0, 30.0, 6.0),
        controller=Pid(0.6, 30.0),
        load=Signal(noise_sd=0.3, noise_tau_s=200.0),
        noise=Signal(noise_sd=0.05),
        pv_start=50.0,
        op_start=50.0,
        pv_limits=(-400.0, 600.0),
        op_limits=(-400.0, 600.0),
        settle_s=2000.0,
    )
    return simulate_loop(replace(spec, **changes), 9000.0, 3.0, seed)


def test_a_triangle_from_a_timer_is_not_relied_on_and_a_valve_that_sticks_is():
    timer = Signal(waves=(Wave(8.0, 240.0, "triangle"),), noise_sd=0.3, noise_tau_s=200.0)
    shaken, sticks = loop(3, load=timer), loop(2, valve=TwoParameterValve(6.0, 3.0))
    for simulated, keeps_time in ((shaken, True), (sticks, False)):
        judgement = audit(simulated.recording("FIC101")).judgement
        assert judgement.verdict == "stiction"
        assert (judgement.reliability == "not_reliable") == keeps_time
        assert any(reason.code == "keeps_time" for reason in judgement.reasons) == keeps_time
        found = timekeeping(simulated.uniform(), detect(simulated.uniform()))
        assert (found.jitter < 0.015) == (found.jitter < 0.04 * found.unlike) == keeps_time


@pytest.mark.parametrize("seed", range(4))
def test_a_limit_cycle_in_a_flow_under_nothing_but_noise_of_the_transmitter_is_relied_on(seed):
    """It is as even as any, and differs from cycle to cycle as little."""
    flow = loop(
        seed,
        plant=first_order(1.0, 5.0, 2.0),
        controller=Pid(0.4, 7.5),
        valve=TwoParameterValve(6.0, 5.0),
        load=Signal(value=3.0),
        noise=Signal(noise_sd=0.03),
    )
    judgement = audit(flow.recording("FIC101")).judgement
    assert (judgement.verdict, judgement.reliability) == ("stiction", "reliable")
