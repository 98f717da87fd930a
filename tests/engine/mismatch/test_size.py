"""What explain states of the size of stiction holds the truth, and a recorded valve position is no cause."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, explain
from app.engine.mismatch.compare.comparison import record_of
from app.engine.mismatch.compare.read_back import best_stem, without_read_backs
from app.engine.mismatch.judge.between_samples import between_samples_too, every_scan_recorded
from app.engine.mismatch.judge.result import Estimate
from app.engine.mismatch.loop.plant import lag
from app.engine.recording import FloatArray
from tests.engine.sticking_loop import SAMPLES, TS, compared, loop

S, J = 6.0, 2.0


def codes(said: Explanation) -> list[str]:
    return [effect.code for effect in said.effects]


@pytest.mark.parametrize("seed", [2, 5])
def test_the_intervals_of_a_limit_cycle_hold_its_valve(seed: int) -> None:
    """By the slopes of the free run S of these was within 0.1 % of a number up to 4 % off."""
    said = explain(compared(loop(seed, S, J)))
    size = {p.name: p for p in said.effects[0].parameters}
    assert codes(said) == ["valve.stiction"]
    assert size["S"].low <= S <= size["S"].high
    assert size["J"].low <= J <= size["J"].high
    assert 0.0 < size["S"].high - size["S"].low < S
    assert all(p.low <= p.value <= p.high for p in size.values())


@pytest.mark.parametrize("seed", [2, 5])
def test_scans_between_the_samples_widen_the_interval_of_a_size(seed: int) -> None:
    """With five scans a sample the stem slips at OP that no sample shows; what explains the samples best is another
    size, and free runs are sure of it.
    """
    said = explain(compared(loop(seed, S, J, samples=600, scans=5)))
    size = said.effects[0].parameters[0]
    assert codes(said) == ["valve.stiction"]
    assert size.low <= S <= size.high
    assert size.high - size.low < S


def test_a_record_of_every_scan_is_known_by_the_controllers_law() -> None:
    whole, fifth = (record_of(compared(loop(2, S, J, scans=scans))) for scans in (1, 5))
    assert every_scan_recorded(whole)
    assert not every_scan_recorded(fifth)
    rounded = replace(whole, op=np.round(whole.op, 2))
    assert not every_scan_recorded(rounded)


def test_an_interval_of_a_size_stays_where_every_scan_is_recorded_or_no_cycle_shows() -> None:
    told = Estimate("S", S, S - 0.1, S + 0.1, "OP")
    whole = record_of(compared(loop(2, S, J)))
    assert between_samples_too(told, whole) == told
    still = replace(whole, op=np.full(whole.samples, 50.0))
    assert between_samples_too(told, still) == told
    once = np.arange(whole.samples) > whole.samples // 2
    moved = replace(whole, op=50.0 + once, pv=np.where(once, 51.0, 50.0))
    assert between_samples_too(told, moved) == told


def test_a_recorded_stem_is_the_valve_and_no_cause() -> None:
    made = loop(1, S, J)
    position = made.v + 0.02 * float(np.std(made.v)) * np.random.default_rng(1).standard_normal(len(made.v))
    said = explain(compared(made, ZT=position))
    assert codes(said) == ["valve.stiction"]
    assert [reason.text[:3] for reason in said.evidence if reason.code == "read_back"] == ["ZT "]


@pytest.mark.parametrize("unit", [(1.0, 0.0), (-0.16, 20.0), (1000.0, 5.0)])
def test_the_unit_of_a_read_back_does_not_matter(unit: tuple[float, float]) -> None:
    made = loop(4, S, J)
    stem = best_stem(unit[0] * made.v + unit[1], made.op)
    assert stem.sticks
    assert abs(stem.S - S) < 0.15 * S


def test_what_shakes_a_loop_is_no_stem() -> None:
    """Neither a wave, nor steps, nor drifting noise that OP answers."""
    at = np.arange(SAMPLES) * TS
    rng = np.random.default_rng(7)
    for cause in (
        4.0 * np.sin(2.0 * np.pi * at / 400.0),
        4.0 * np.sign(np.sin(2.0 * np.pi * at / 700.0)),
        np.cumsum(0.3 * rng.standard_normal(SAMPLES)),
    ):
        moves = tuple((float(t), float(m)) for t, m in zip(at, np.diff(cause, prepend=0.0), strict=True) if m != 0.0)
        made = loop(8, S=0.0, J=0.0, load=moves)
        signal = cause + 0.02 * rng.standard_normal(SAMPLES)
        assert float(np.std(made.op)) > 0.5
        assert not best_stem(signal, made.op).sticks
        assert without_read_backs(compared(made, FI=signal)).measured[0][0] == "FI"


def test_a_signal_that_stands_or_follows_op_is_left_to_the_other_test() -> None:
    made = loop(9, S, J)
    kept = without_read_backs(compared(made, A=np.full(SAMPLES, 3.0), B=lag(made.op, 1.0, TS)))
    assert [name for name, _ in kept.measured] == ["A", "B"]
    assert kept.notes == ()


def forward() -> tuple[FloatArray, FloatArray, FloatArray]:
    """PV and OP of a linear loop that a measured load moves in jumps, and the load; OP answers 0.6 of it at once."""
    rng = np.random.default_rng(1)
    cause = np.cumsum(np.where(rng.random(SAMPLES) < 0.02, rng.normal(0.0, 3.0, SAMPLES), 0.0))
    pv, op = np.zeros(SAMPLES), np.zeros(SAMPLES)
    level = integral = 0.0
    for k in range(SAMPLES):
        level += (1.0 - np.exp(-TS / 20.0)) * (op[k - 1] + cause[k - 1] - level) if k else 0.0
        pv[k] = level + 0.1 * rng.standard_normal()
        integral -= TS / 40.0 * pv[k]
        op[k] = 0.6 * (integral - pv[k]) - 0.6 * cause[k]
    return 50.0 + pv, 50.0 + op, 100.0 + cause


def test_a_cause_that_op_answers_by_feedforward_is_no_stem() -> None:
    """It jumps where OP jumps, as a stem does: it was left out as the valve's position, and nothing was found."""
    pv, op, cause = forward()
    assert best_stem(cause, op).sticks
    said = explain(Comparison("FIC1", TS, op, pv, None, (("FF", cause),)))
    assert codes(said) == ["disturbance.coupling"]
    assert not [reason for reason in said.evidence if reason.code == "read_back"]


def test_a_coarse_copy_of_op_is_no_stem() -> None:
    """An exception-reported OP stands and jumps as a stem does; PV follows the OP beneath."""
    made = loop(3, S=0.0, J=0.0, load=tuple((100.0 * k, (-1.0) ** k) for k in range(72)))
    copy = made.op.copy()
    for k in range(1, len(copy)):
        copy[k] = made.op[k] if abs(made.op[k] - copy[k - 1]) > 0.3 else copy[k - 1]
    assert best_stem(copy, made.op).sticks
    assert without_read_backs(compared(made, OUT=copy)).notes == ()


def test_a_stem_that_jumps_all_its_way_is_sized_beside_our_own_loop() -> None:
    """Found from OP, our own loop had the stem's work in it: S was 2.2 (1.1 to 3.0)."""
    said = explain(compared(loop(1, S=6.0, J=6.0)))
    size = {p.name: p for p in said.effects[0].parameters}
    assert codes(said)[0] == "valve.stiction"
    assert size["S"].low <= 6.0 <= size["S"].high
    assert abs(size["S"].value - 6.0) < 0.3
