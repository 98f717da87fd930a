"""Free run: PV simulated from OP alone tells a sticky valve from a linear one, and holds on the other half."""

import numpy as np
import pytest

from app.engine.freerun import controller_action, cycle_range, free_run, through_process, valve_position
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop


def loop(S: float, J: float, **changes):
    spec = LoopSpec(
        plant=first_order(1.0, 3.0, 1.0),
        controller=Pid(Kc=0.3, Ti_s=6.0),
        valve=TwoParameterValve(S, J),
        noise=Signal(noise_sd=0.02),
        settle_s=300.0,
        **changes,
    )
    return simulate_loop(spec, 1200.0, 1.0, seed=3)


def test_a_sticky_valve_explains_more_than_a_linear_one():
    sticky = loop(2.0, 2.0, upset=Signal(value=3.0))
    found = free_run(sticky.pv, sticky.op, 75)
    assert found.gain > 0.5
    assert found.fit_sticky > found.fit_linear
    assert found.held_sticky > found.held_linear
    assert found.S_share > 0.2


def test_a_linear_loop_shaken_from_outside_gains_nothing():
    linear = loop(0.0, 0.0, upset=Signal(noise_sd=1.0, noise_tau_s=20.0))
    assert free_run(linear.pv, linear.op, 75).gain < 0.1


def test_what_pv_did_before_the_dead_time_is_asked_of_no_model():
    """OP tells nothing of it: PV that is OP nine samples later is explained whole, whatever it was until then."""
    rng = np.random.default_rng(1)
    op = np.sin(2 * np.pi * np.arange(120) / 40.0) + 0.3 * np.sin(2 * np.pi * np.arange(120) / 13.0)
    pv = np.concatenate((rng.choice([-1.0, 1.0], 9), op[:-9]))
    found = free_run(pv, op, 40)
    assert found.fit_linear > 0.97
    assert found.held_linear > 0.95


def test_sign_scale_and_offset_change_nothing():
    sticky = loop(2.0, 2.0, upset=Signal(value=3.0))
    one = free_run(sticky.pv, sticky.op, 75)
    other = free_run(-0.01 * sticky.pv + 5.0, 40 * sticky.op - 3.0, 75)
    for name in ("fit_linear", "fit_sticky", "gain", "causal_gain", "held_gain", "S_share", "J_share"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), abs=1e-6), name


def test_valve_holds_until_its_band_is_crossed():
    op = np.concatenate((np.arange(0.0, 5.1, 0.5), np.arange(4.5, -0.1, -0.5)))
    v = valve_position(op, 2.0, 0.0)
    # Pure deadband: the stem follows half a band behind and stands still for a whole band after the reversal.
    assert v[10] == pytest.approx(4.0)
    np.testing.assert_allclose(v[10:15], 4.0)
    assert v[16] < 4.0


def test_a_lag_settles_at_its_input_and_an_integrator_sums():
    np.testing.assert_allclose(through_process(np.ones(5), 2.0), 1.0)
    np.testing.assert_allclose(through_process(np.array([0.0, 1.0, 2.0]), -1.0), [-1.0, -1.0, 0.0])


def test_cycle_range_is_the_median_over_cycles():
    assert cycle_range(np.array([0.0, 1.0, 0.0, 3.0, 0.0, 1.0, 9.0]), 2) == 1.0
    assert cycle_range(np.array([0.0, 5.0]), 10) == 5.0


@pytest.mark.parametrize("Kc", [-0.8, 0.8])
def test_the_sign_of_the_controller_is_seen(Kc):
    rng = np.random.default_rng(0)
    pv = np.convolve(rng.normal(size=520), np.ones(21) / 21, "valid")
    op = -Kc * (pv + np.cumsum(pv) / 30.0)
    sign, share = controller_action(pv - pv.mean(), op - op.mean())
    assert sign == -np.sign(Kc)
    assert 0.0 < share < 1.0


def test_steps_of_op_that_are_just_a_band_slip_in_no_unit():
    """Of which rounding would make some more and some less."""
    sticky = loop(2.0, 2.0, upset=Signal(value=3.0))
    op = np.round(sticky.op)
    found = free_run(sticky.pv, op, 75)
    for scale, offset in ((0.01, 0.0), (1.8, 32.0), (3.7, -50.1)):
        assert vars(free_run(sticky.pv, scale * op + offset, 75)) == pytest.approx(vars(found), abs=1e-6)
