"""Historian compression: what is kept, and how far what is rebuilt may be off."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.engine.simulate import Compression, keep, rebuild

KINDS: list[Compression] = ["exception", "swinging_door"]


@pytest.mark.parametrize("kind", KINDS)
@given(seed=st.integers(0, 500), deviation=st.floats(0.0, 3.0))
def test_rebuilt_signal_is_never_off_by_more_than_the_band(kind: Compression, seed: int, deviation: float) -> None:
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.5, 2.0, 200))
    value = np.cumsum(rng.standard_normal(200))
    kept = keep(time_s, value, deviation, kind)
    assert np.abs(rebuild(time_s, value, kept, kind) - value).max() <= deviation + 1e-9


def test_swinging_door_keeps_the_corners_of_a_polyline_only() -> None:
    time_s = np.arange(9.0)
    value = np.array([0.0, 1, 2, 3, 4, 3, 2, 1, 0])
    assert np.flatnonzero(keep(time_s, value, 0.1, "swinging_door")).tolist() == [0, 4, 8]


def test_exception_reporting_keeps_what_left_the_band() -> None:
    value = np.array([0.0, 0.4, 0.9, 1.1, 1.5, 2.2, 2.2])
    kept = keep(np.arange(7.0), value, 1.0, "exception")
    assert np.flatnonzero(kept).tolist() == [0, 3, 5, 6]
    assert rebuild(np.arange(7.0), value, kept, "exception").tolist() == [0.0, 0.0, 0.0, 1.1, 1.1, 2.2, 2.2]
