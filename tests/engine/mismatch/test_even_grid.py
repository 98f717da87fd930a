"""What of a recording with gaps is compared: every sample that was recorded, and nothing within a gap."""

import numpy as np
import pytest

from app.engine.mismatch.compare.even_grid import uniform
from app.engine.recording import FloatArray


def groups(each: int, missing: int) -> FloatArray:
    """Times of 200 groups of samples a second apart, with gaps between the groups."""
    firsts = np.arange(200) * float(each + missing)
    return (firsts[:, None] + np.arange(each)).ravel()


@pytest.mark.parametrize(("each", "missing"), [(3, 3), (4, 7), (30, 40)])
@pytest.mark.parametrize("interval", [1.0, 0.1])
def test_every_sample_that_was_recorded_is_known_and_none_within_a_gap(
    each: int, missing: int, interval: float
) -> None:
    at = groups(each, missing) * interval
    found = uniform("loop", at, {"op": np.sin(at), "pv": np.cos(at)}, {})
    grid = np.arange(len(found.pv)) * found.sampling_interval_s
    assert found.known is not None
    assert found.known.sum() == len(at)
    later = np.searchsorted(at, grid).clip(1, len(at) - 1)
    recorded = np.minimum(np.abs(grid - at[later - 1]), np.abs(grid - at[later])) < 0.02 * interval
    np.testing.assert_array_equal(found.known, recorded)


def test_a_grid_point_beside_the_end_of_a_gap_is_not_known() -> None:
    at = np.concatenate((np.arange(200.0), 204.5 + np.arange(200.0)))
    found = uniform("loop", at, {"op": np.sin(at), "pv": np.cos(at)}, {})
    assert found.known is not None
    assert np.flatnonzero(~found.known).tolist() == [200, 201, 202, 203, 204]


def interval_of(at: FloatArray) -> float:
    return uniform("loop", at, {"op": np.sin(at), "pv": np.cos(at)}, {}).sampling_interval_s


def test_nights_without_the_days_between_them_keep_their_sampling() -> None:
    """As samples that came on change they were put on a grid four times as coarse, which what is fast fell through."""
    night = 10.0 * np.arange(2880)
    nights = np.concatenate([night, night + 28 * 3600.0, night + 56 * 3600.0])
    assert interval_of(nights) == 10.0
    years_apart = np.concatenate([night, night + 3e9])
    assert interval_of(years_apart) > 1e5, "so many points hold no more than the samples"


def test_samples_that_came_on_change_are_put_on_as_many_points() -> None:
    at = np.cumsum(np.where(np.arange(2000) % 4 == 3, 30.0, 1.0)) - 1.0
    assert interval_of(at) == pytest.approx(at[-1] / 1999)
    often_waiting = np.cumsum(np.where(np.arange(2000) % 20 == 19, 90.0, 1.0)) - 1.0
    assert interval_of(often_waiting) == pytest.approx(often_waiting[-1] / 1999)
