"""Simulate a valve whose parameters are known, identify it, and get them back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.engine.armax import SearchSpace
from app.engine.recording import UniformRecord
from app.engine.reference.hammerstein import HammersteinConfig, Identification, identify_one_parameter
from app.engine.simulate import (
    LinearValve,
    LoopSpec,
    OneParameterValve,
    Pid,
    Signal,
    TwoParameterValve,
    first_order,
    simulate_loop,
)

SPACE = SearchSpace(3, 3, 3)


def loop_with(valve: object, tau_s: float, seed: int) -> UniformRecord:
    """An identifiable loop: the set point steps about, so that OP travels many times the band in both directions.

    No noise on the measurement: OP's first sample is then where the valve rests, as the identification assumes.
    """
    changes = np.diff(np.random.default_rng(seed).uniform(-20.0, 20.0, 60), prepend=0.0)
    steps = tuple((20.0 + 25.0 * k, float(change)) for k, change in enumerate(changes))
    spec = LoopSpec(
        first_order(1.3, tau_s, 1.0),
        Pid(0.5, 1.5 * tau_s),
        valve,
        sp=Signal(steps=steps),
        load=Signal(noise_sd=0.05, noise_tau_s=5.0),
    )
    return simulate_loop(spec, 1500.0, 1.0, seed).uniform()


@given(d=st.floats(2.0, 15.0), tau_s=st.floats(4.0, 15.0), seed=st.integers(0, 100))
@settings(max_examples=15)
def test_one_parameter_band_on_the_grid_is_recovered(d: float, tau_s: float, seed: int) -> None:
    # Off the grid every jump comes a few samples early or late and another point may win: the grid must hold the truth.
    record = loop_with(OneParameterValve(d), tau_s, seed)
    config = HammersteinConfig(d_max_share=2.9 * d / np.ptp(record.op))
    found = identify_one_parameter(record, SPACE, config)
    assert found.stiction
    assert found.d_best == pytest.approx(d)


@given(
    S=st.floats(4.0, 15.0),
    slip=st.sampled_from([0.0, 0.25, 0.5, 1.0]),
    tau_s=st.floats(4.0, 15.0),
    seed=st.integers(0, 100),
)
@settings(max_examples=15)
def test_two_parameter_bands_on_the_grid_are_recovered(S: float, slip: float, tau_s: float, seed: int) -> None:
    record = loop_with(TwoParameterValve(S, slip * S), tau_s, seed)
    config = HammersteinConfig(S_max_share=2.0 * S / np.ptp(record.op))
    found = Identification(record, config).two_parameter(SPACE)
    assert found.stiction
    assert found.S_best == pytest.approx(S)
    assert found.J_best == pytest.approx(slip * S)


@given(tau_s=st.floats(4.0, 15.0), seed=st.integers(0, 100))
@settings(max_examples=12)
def test_linear_valve_has_no_band_beyond_a_grid_step(tau_s: float, seed: int) -> None:
    found = identify_one_parameter(loop_with(LinearValve(), tau_s, seed), SPACE, HammersteinConfig())
    assert found.d_best <= found.d[1]
