"""What the free-run fit says of the size of stiction, on simulated limit cycles whose S and J are known.

The bounds are what holds today: the grid reads S low, by a quarter in the median of many loops, and J is not
identifiable where the stem only jumps between stuck positions, because the process gain takes the size of the jump.
"""

import numpy as np
import pytest

from app.engine.freerun import cycle_range, free_run
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop

PER_CYCLE = 40
_PLANTS = (first_order(1.0, 10.0, 3.0), first_order(1.0, 6.0, 8.0), first_order(2.0, 20.0, 4.0))
_CONTROLLERS = (Pid(0.8, 10.0), Pid(0.4, 9.0), Pid(0.8, 18.0))


def limit_cycle(k, S, J):
    """A noisy limit cycle, PER_CYCLE samples a cycle, the last 15 cycles of it."""
    spec = LoopSpec(
        plant=_PLANTS[k],
        controller=_CONTROLLERS[k],
        valve=TwoParameterValve(S, J),
        load=Signal(value=0.6 * S),
        noise=Signal(noise_sd=0.01 * S),
        settle_s=1000.0,
    )
    loop = simulate_loop(spec, 6000.0, 0.25, seed=k)
    crossings = np.flatnonzero((loop.true_pv[:-1] < 0.0) & (loop.true_pv[1:] >= 0.0))
    per_cycle = float(np.median(np.diff(crossings[np.append(True, np.diff(crossings) > 20)])))
    at = np.arange(15 * PER_CYCLE) * per_cycle / PER_CYCLE + len(loop.pv) - 15 * per_cycle
    return (np.interp(at, np.arange(len(loop.pv)), x) for x in (loop.pv, loop.op))


def estimated(k, S, J):
    pv, op = limit_cycle(k, S, J)
    found = free_run(pv, op, PER_CYCLE)
    S_found = found.S_share * cycle_range(op, PER_CYCLE)
    return S_found, found.J_share * S_found


@pytest.fixture(scope="module")
def shares():
    """S found over S, for three loops with three slip jumps each."""
    return np.array([estimated(k, 4.0, 4.0 * ratio)[0] / 4.0 for k in range(3) for ratio in (0.2, 0.4, 0.9)])


def test_the_size_of_S_is_found_to_a_third_in_the_median(shares):
    assert np.median(np.abs(shares - 1.0)) <= 0.33


def test_S_is_never_read_half_as_large_again(shares):
    assert np.max(shares) < 1.5


def test_S_grows_with_the_valve_in_proportion():
    small, large = estimated(0, 2.0, 0.8)[0], estimated(0, 8.0, 3.2)[0]
    assert large / small == pytest.approx(4.0, rel=0.05)


def test_a_linear_valve_has_no_gain_from_stiction():
    rng = np.random.default_rng(1)
    t = np.arange(15 * PER_CYCLE)
    op = np.sin(2 * np.pi * t / PER_CYCLE) + 0.3 * np.sin(2 * np.pi * t / 13.0)
    pv = np.convolve(op, np.exp(-np.arange(60) / 10.0) / 10.0)[: len(t)] + 0.01 * rng.standard_normal(len(t))
    assert free_run(pv, op, PER_CYCLE).gain < 0.1
