"""Whether PV answers OP: behind a valve that stands fast it does not, in a loop at work it does, in any unit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from app.engine.audit import audit
from app.engine.causality.answering import ORDER, goes_its_own_way
from app.engine.recording import Recording, UniformRecord
from app.engine.simulate import LoopSpec, Pid, Signal, StuckValve, TwoParameterValve, first_order, simulate_loop

N = 4000
WANDER_S = 400.0


def uniform(pv: np.ndarray, op: np.ndarray, sp: np.ndarray | None = None) -> UniformRecord:
    return UniformRecord(1.0, pv, op, sp, np.zeros(len(pv), bool))


def stood(seed: int, n: int = N) -> UniformRecord:
    """A load that wanders is all of PV, and OP is what a controller makes of it."""
    rng = np.random.default_rng(seed)
    pole = np.exp(-1.0 / WANDER_S)
    pv = 2.0 * lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], rng.normal(size=n)) + 0.1 * rng.normal(size=n)
    return uniform(pv, -0.5 * pv - 0.002 * np.cumsum(pv))


def recorded(seed: int, valve: TwoParameterValve | StuckValve, ti_s: float = 10.0) -> Recording:
    spec = LoopSpec(
        plant=first_order(1.0, 10.0, 3.0), controller=Pid(1.0, ti_s), valve=valve,
        load=Signal(noise_sd=2.0, noise_tau_s=WANDER_S), noise=Signal(noise_sd=0.1), pv_start=50.0, op_start=50.0,
        op_limits=(0.0, 100.0),
    )  # fmt: skip
    return simulate_loop(spec, float(N), 1.0, seed).recording("loop")


def work(seed: int, ti_s: float = 10.0) -> UniformRecord:
    made = recorded(seed, TwoParameterValve(0.2, 0.05), ti_s)
    return uniform(made.pv, made.op, made.sp)


def test_behind_a_valve_that_stands_fast_few_seem_to_answer() -> None:
    assert sum(goes_its_own_way(stood(seed)) for seed in range(20)) >= 19


@pytest.mark.parametrize("ti_s", [10.0, 40.0])
def test_loops_at_work_answer(ti_s: float) -> None:
    assert not any(goes_its_own_way(work(seed, ti_s)) for seed in range(10))


@pytest.mark.parametrize("seed", range(4))
def test_units_and_signs_are_free(seed: int) -> None:
    for record in (stood(seed), work(seed)):
        other = replace(record, pv=-40.0 * record.pv + 1000.0, op=0.01 * record.op - 3.0, sp=None)
        assert goes_its_own_way(other) == goes_its_own_way(replace(record, sp=None))


def test_a_unit_that_is_shut_down_shows_no_answer() -> None:
    silent = next(record for seed in range(20) if goes_its_own_way(record := stood(seed)))
    pv, op = silent.pv + 50.0, silent.op + 50.0
    pv[2000:2600], op[2000:2600] = 0.0, 0.0
    assert goes_its_own_way(replace(silent, pv=pv, op=op))


def test_a_set_point_that_pv_follows_carries_nothing_away() -> None:
    rng = np.random.default_rng(3)
    sp = np.repeat(rng.normal(scale=20.0, size=8), N // 8)
    held = uniform(sp + rng.normal(size=N), rng.normal(size=N), sp)
    assert not goes_its_own_way(held)
    assert goes_its_own_way(replace(held, sp=None))


def test_of_a_few_samples_no_more_is_asked_than_they_have() -> None:
    assert not goes_its_own_way(stood(1, 12 * ORDER))


@pytest.mark.parametrize("scale", [1.0, -40.0, 1.0 / 3.0, 32.0])
@pytest.mark.parametrize("n", [300, 1500, 4000])
def test_what_is_foretold_but_for_rounding_is_left_alone_in_any_unit(n: int, scale: float) -> None:
    at = 2.0 * np.pi * np.arange(n) / 150.0
    assert not goes_its_own_way(uniform(scale * np.sin(at) + 7.0, np.cos(at + 0.3)))
    assert not goes_its_own_way(uniform(scale * at, 50.0 - at**2))


def test_a_valve_that_stands_fast_is_not_cleared() -> None:
    said = [audit(recorded(seed, StuckValve(), ti_s=1000.0)).judgement for seed in range(6)]
    cleared = [one for one in said if one.verdict == "no_stiction" and one.reliability == "reliable"]
    doubted = [one for one in said if any(reason.code == "no_answer" for reason in one.reasons)]
    assert len(cleared) <= 1
    assert len(doubted) >= 3
    assert all(one.reliability == "not_reliable" for one in doubted)
