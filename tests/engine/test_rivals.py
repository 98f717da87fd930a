"""Rival explanations: each stands out on the loop that it explains, and not on a sticky one."""

import numpy as np
import pytest

from app.engine.features import extract
from app.engine.oscillation import detect
from app.engine.recording import UniformRecord
from app.engine.rivals import Rival, compete

N = 1200
T = np.arange(N)
CYCLE = 2 * np.pi * T / 50


def noise(seed: int, size: float = 1.0) -> np.ndarray:
    return size * np.random.default_rng(seed).normal(size=N)


def rivals(pv, op, sp=None) -> dict[str, Rival]:
    record = UniformRecord(1.0, np.asarray(pv, float), np.asarray(op, float), sp, np.zeros(N, bool))
    oscillation = detect(record)
    return {rival.cause: rival for rival in compete(record, oscillation, extract(record, oscillation))}


def test_op_at_its_limit_while_pv_swings_is_saturation():
    found = rivals(np.sin(CYCLE) + noise(1, 0.01), np.maximum(np.cos(CYCLE), 0.2) + 0.0)
    assert found["saturated_op"].stands_out
    assert found["saturated_op"].counts > 0


def test_pv_on_three_values_is_quantisation():
    found = rivals(np.round(1.2 * np.sin(CYCLE) + noise(2, 0.2)), np.cos(CYCLE) + noise(3, 0.05))
    assert found["quantised_sensor"].stands_out


def test_pv_and_op_that_follow_a_moving_set_point_are_explained_by_it():
    sp = np.cumsum(noise(4))
    found = rivals(sp + noise(5, 0.1), 2 * sp + noise(6, 0.1), sp=sp)
    assert found["set_point_following"].stands_out


def test_op_in_line_with_a_wandering_pv_is_a_disturbance():
    pv = np.convolve(np.random.default_rng(7).normal(size=N + 20), np.ones(21) / 21, "valid")
    assert rivals(pv, -3 * pv + noise(8, 0.01))["disturbance"].stands_out


def test_pure_sines_in_line_are_tuning_or_a_sine_from_outside():
    found = rivals(np.sin(CYCLE) + noise(9, 0.01), -np.sin(CYCLE) + noise(10, 0.01))
    assert found["tuning_or_sinusoidal_disturbance"].stands_out


def test_white_noise_is_no_oscillation():
    assert rivals(noise(11), noise(12))["no_oscillation"].stands_out


def test_a_sticky_loop_leaves_no_rival_that_counts_against_it():
    square, triangle = np.sign(np.cos(CYCLE + 0.3)), np.arcsin(np.sin(CYCLE))
    found = rivals(square + noise(13, 0.05), triangle + noise(14, 0.01))
    assert not [r.cause for r in found.values() if r.stands_out and r.counts]


@pytest.mark.parametrize("sp", [None, np.full(N, 5.0)])
def test_a_set_point_that_stands_explains_nothing(sp):
    assert rivals(np.sin(CYCLE), np.cos(CYCLE), sp=sp)["set_point_following"].strength == 0.0
