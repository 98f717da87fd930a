"""The physical valve: the stiff friction law stays stable, and it is He's model where friction alone decides."""

import numpy as np
import pytest

from app.engine.recording import FloatArray
from app.engine.simulate import PhysicalActuator
from app.engine.simulate.actuator import compiled, move
from app.engine.valve import CLASSIC, PACKED, PhysicalValve, physical, two_parameter_he
from app.engine.valve.physical import physical_step

SLOW = 50.0 * np.sin(2.0 * np.pi * np.arange(400) / 200.0)


def stem(op: FloatArray, Ts: float, valve: PhysicalValve) -> FloatArray:
    """Where the valve of a simulated loop stands (N,), held at OP for Ts (s) from sample to sample."""
    moved = compiled(PhysicalActuator(valve), op[0], Ts)
    return np.array([move(moved.kind, moved.state, moved.parameters, u) for u in op])


def test_travel_and_bands_of_the_published_sets():
    """4 in of travel for the classic set; S 25.3 % and J 1.3 % were fitted to the packed valve by its authors."""
    assert pytest.approx(0.1016, abs=1e-4) == CLASSIC.travel_m
    assert pytest.approx(1.297, abs=0.01) == PACKED.J_pct
    assert pytest.approx(25.3, abs=1.5) == PACKED.S_pct


def test_the_classic_valve_is_hes_model_at_one_sample_a_second():
    """Its 9 ms are nothing within a second: what is left is f_S = F_s/k and f_D = F_c/k."""
    x = stem(SLOW, 1.0, CLASSIC)
    he = two_parameter_he(SLOW, np.array([CLASSIC.S_pct]), np.array([CLASSIC.J_pct]))[0]
    assert np.max(np.abs(x - he)) < 0.02


def test_the_packed_valve_follows_hes_model_within_a_slip_jump_and_its_lag():
    """Far below the Stribeck velocity the heavily damped stem creeps at F_s instead of slipping down to F_c."""
    fine = 50.0 * np.sin(2.0 * np.pi * np.arange(4000) / 2000.0)
    x = stem(fine, 1.0, PACKED)
    he = two_parameter_he(fine, np.array([PACKED.S_pct]), np.array([PACKED.J_pct]))[0]
    assert np.max(np.abs(x - he)) < 1.1 * PACKED.J_pct


@pytest.mark.parametrize("valve", [CLASSIC, PACKED])
@pytest.mark.parametrize("Ts", [1e-4, 0.01, 0.1, 1.0, 60.0])
def test_stable_at_every_sampling_interval(valve, Ts):
    """F_v = 125000 N s/m against 1.6 kg is a time constant of 13 us: an explicit step would blow up."""
    x = stem(SLOW, Ts, valve)
    assert np.all(np.isfinite(x))
    assert np.max(np.abs(x)) <= 50.0 + 1e-9


@pytest.mark.parametrize("valve", [CLASSIC, PACKED])
def test_finer_substeps_change_little(valve):
    fine = valve.parameters()
    fine[-1] /= 40.0
    state = np.zeros(2)
    x = np.array([physical_step(u, state, fine, 0.5) for u in SLOW])
    assert np.max(np.abs(stem(SLOW, 0.5, valve) - x)) < 0.03


@pytest.mark.parametrize("valve", [CLASSIC, PACKED])
def test_a_quick_stem_moves_as_if_the_root_had_been_searched(valve, monkeypatch):
    """A band a thousandth of F_s wide and a Stribeck velocity of a tenth are where the search has most to do."""

    def searched(parameters) -> list[float]:
        state = np.zeros(2)
        return [physical_step.py_func(u, state, parameters, 0.02) for u in SLOW[:60]]

    monkeypatch.setattr(physical, "_velocity_after", physical._velocity_after.py_func)
    narrow, slow = valve.parameters(), valve.parameters()
    narrow[4], slow[5] = 1.001 * narrow[3], 0.1 * slow[5]
    given = [valve.parameters(), narrow, slow]
    quick = [searched(parameters) for parameters in given]
    monkeypatch.setattr(physical, "FAST", np.inf)
    assert [searched(parameters) for parameters in given] == quick


def test_stuck_below_the_static_friction_and_free_above_it():
    f_S = (CLASSIC.S_pct + CLASSIC.J_pct) / 2.0
    assert stem(np.array([0.0, 0.99 * f_S]), 1.0, CLASSIC).tolist() == [0.0, 0.0]
    assert stem(np.array([0.0, 1.01 * f_S]), 1.0, CLASSIC)[1] > 0.5 * CLASSIC.J_pct


def test_sign_and_offset_pass_through():
    x = stem(SLOW, 1.0, PACKED)
    assert np.allclose(stem(-SLOW, 1.0, PACKED), -x, atol=1e-9)
    assert np.allclose(stem(SLOW + 10.0, 1.0, PACKED), x + 10.0, atol=1e-6)
