"""What explain states of the size of stiction holds the truth, and a recorded valve position is no cause."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, Explanation, explain
from app.engine.mismatch.compare.comparison import record_of
from app.engine.mismatch.compare.read_back import best_stem, without_read_backs
from app.engine.mismatch.judge.between_samples import between_samples_too, every_scan_recorded
from app.engine.mismatch.judge.result import Estimate
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.plant import lag
from app.engine.recording import FloatArray
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, second_order, simulate_loop
from tests.engine.sticking_loop import SAMPLES, STARTED, TS, compared, loop

pytestmark = pytest.mark.usefixtures("one_competition")
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


def recorded_of(
    scans: int = 1,
    decimals: float = 0.01,
    noise: float = 0.2,
    Td: float = 0.0,
    limits: tuple[float, float] = (0.0, 100.0),
    sp: tuple[tuple[float, float], ...] = (),
    seed: int = 2,
    two_lags: bool = False,
    tau_s: float = 0.0,
    sensed: float = 0.0,
) -> Experiment:
    """A sticking loop, as it is recorded: each of `scans` scans a sample sees PV as it is, not as it was rounded."""
    spec = LoopSpec(
        plant=second_order(1.0, 12.0, 1.2, 4.0) if two_lags else first_order(1.0, 20.0, 3.0),
        controller=Pid(0.6 if two_lags else 1.0, 25.0, Td),
        valve=TwoParameterValve(S, J),
        load=Signal(steps=STARTED),
        noise=Signal(noise_sd=noise, noise_tau_s=tau_s),
        sp=Signal(steps=sp),
        pv_start=50.0,
        op_start=50.0,
        op_limits=limits,
        pv_resolution=sensed,
        step_s=TS / scans,
    )
    made = simulate_loop(spec, 800 * TS, TS, seed)
    pv, op = ((np.round(x / decimals) * decimals if decimals else x) for x in (made.pv, made.op))
    return record_of(Comparison("loop", TS, op, pv, made.sp))


ROUNDED = {
    "as computed": {"decimals": 0.0},
    "two decimals": {},
    "two lags": {"two_lags": True},
    "large noise": {"noise": 0.8, "decimals": 0.1},
    "small noise": {"noise": 0.05, "decimals": 0.002},
    "PID": {"Td": 2.0},
    "set point steps": {"sp": ((800.0, 3.0), (2400.0, -4.0))},
    "clipped": {"limits": (43.0, 52.0), "sp": tuple((400.0 * k, 7.0 * (-1.0) ** k) for k in range(1, 10))},
    "slow noise": {"tau_s": 10.0},
}
TOLD_APART = pytest.mark.parametrize("case", ROUNDED)


@TOLD_APART
def test_a_record_of_every_scan_is_known_by_the_controllers_law(case: str) -> None:
    """Rounded to decimals, as a plant exports it, every record counted as one with scans between its samples."""
    assert [every_scan_recorded(recorded_of(seed=seed, **ROUNDED[case])) for seed in range(4)] == 4 * [True]


@TOLD_APART
@pytest.mark.parametrize("scans", [2, 5, 20])
def test_scans_between_the_samples_are_known_by_the_noise_that_op_answered(case: str, scans: int) -> None:
    said = [every_scan_recorded(recorded_of(scans, seed=seed, **ROUNDED[case])) for seed in range(4)]
    assert said == 4 * [False]


@pytest.mark.parametrize("scans", [1, 5])
@pytest.mark.parametrize(("decimals", "noise"), [(0.1, 0.02), (0.1, 0.1), (0.5, 0.02), (0.5, 0.1), (0.5, 0.4)])
def test_coarse_rounding_hides_whether_scans_lie_between(scans: int, decimals: float, noise: float) -> None:
    assert not every_scan_recorded(recorded_of(scans, decimals, noise))


@pytest.mark.parametrize("scans", [1, 5])
def test_gaps_in_a_record_tell_nothing_of_its_scans(scans: int) -> None:
    """PV was filled in, OP stands there, at values that no rounding gave."""
    record = recorded_of(scans)
    gap = np.zeros(record.samples, dtype=bool)
    gap[100:140] = gap[400:403] = gap[600] = True
    pv, op = np.where(gap, 50.003, record.pv), np.where(gap, 51.0007, record.op)
    assert every_scan_recorded(replace(record, pv=pv, op=op, usable=~gap)) == (scans == 1)


@pytest.mark.parametrize("noise", [0.15, 0.2, 0.3, 0.4, 0.6])
def test_scans_between_are_known_where_the_controller_saw_pv_rounded(noise: float) -> None:
    """Then PV's rounding is in OP too, and what scans between leave was taken for it."""
    said = [every_scan_recorded(recorded_of(5, noise=noise, sensed=0.1, seed=seed)) for seed in range(4)]
    assert said == 4 * [False]


def test_a_controller_that_does_not_integrate_tells_nothing_of_its_scans() -> None:
    """Its OP follows from the samples, however many scans lie between them."""
    record = recorded_of(5)
    followed = replace(record, op=50.0 - 0.7 * (record.pv - 50.0), sp=None)
    assert not every_scan_recorded(followed)


def test_records_that_show_no_law_tell_nothing_of_their_scans() -> None:
    rng, whole = np.random.default_rng(0), recorded_of()
    few = record_of(Comparison("few", TS, whole.op[:9], whole.pv[:9], None))
    for record in (
        few,
        replace(whole, op=np.full(whole.samples, 50.0)),
        replace(whole, pv=np.full(whole.samples, 50.0)),
        replace(whole, usable=np.zeros(whole.samples, dtype=bool)),
        replace(whole, op=whole.op + rng.normal(0.0, 0.05, whole.samples)),
    ):
        assert not every_scan_recorded(record)


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
    made = loop(2, S, J)
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
