"""Stems and relays of a signal: by how much it has turned, on which side it is."""

import numpy as np
import pytest

from app.engine.signals.turning import relays, stems, usual_range

SIZES, JUMP = np.array([0.1, 0.4]), 0.2


@pytest.fixture
def wave() -> np.ndarray:
    return 3.0 * np.sin(np.arange(2000) / 40.0)


def test_a_stem_is_behind_where_the_signal_turns(wave: np.ndarray) -> None:
    moved = stems(wave, SIZES, JUMP)
    over_range = (wave - wave[0]) / usual_range(wave)
    apart = np.abs(moved - over_range)[:, 200:]
    assert apart.max(axis=1) == pytest.approx(0.5 * (1.0 + JUMP) * SIZES, rel=0.05)
    assert np.all(np.ptp(moved, axis=1) < np.ptp(over_range))


@pytest.mark.parametrize("scale", [-2.0, 1e-6, 1e6])
def test_stems_have_no_unit_and_no_sign(wave: np.ndarray, scale: float) -> None:
    assert stems(scale * wave + 7.0, SIZES, JUMP) == pytest.approx(stems(wave, SIZES, JUMP), abs=1e-6)


def test_a_relay_holds_its_side_within_its_band(wave: np.ndarray) -> None:
    told = relays(wave, SIZES)
    assert told[:, 0].tolist() == [0.0, 0.0]
    assert set(np.unique(told[:, 100:])) == {-1.0, 1.0}
    changes = np.flatnonzero(np.diff(told[1])[100:]) + 100
    half = 0.5 * SIZES[1] * usual_range(wave)
    assert np.all(np.abs(wave[changes + 1]) > half)
    assert np.all(np.abs(wave[changes]) <= half)
    assert relays(-wave, SIZES) == pytest.approx(-told)
