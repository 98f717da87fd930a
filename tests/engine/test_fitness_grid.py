"""The even record that is made of holes, late scans and stamps of different times."""

import numpy as np
import pytest

from app.engine.fitness import FitnessConfig, assess
from app.engine.fitness.holes import newest_without_hole
from app.engine.recording import Recording
from tests.engine.cycling_loop import N, cycling, outcomes, refused


@pytest.mark.parametrize(
    ("hole_at", "judged", "said"),
    [
        # as it is now, though more is known of before
        (250, slice(250, 400), "the newest of its long stretches has 150 of 400 samples"),
        (150, slice(150, 400), "the newest of its long stretches has 250 of 400 samples"),
        (305, slice(0, 305), "the 95 samples after it are not used"),  # too few to be judged
        (
            320,
            slice(0, 320),
            "has 320 of 400 samples; at least 100 are needed; the 80 samples after it are not used",
        ),
    ],
)
def test_a_hole_splits_the_record_and_the_newest_long_part_is_judged(hole_at: int, judged: slice, said: str):
    t = np.arange(N, dtype=float)
    t[hole_at:] += 3600.0
    fitness = assess(cycling(time_s=t))
    assert (fitness.gaps, fitness.record.samples, fitness.filled_share) == (1, judged.stop - judged.start, 0.0)
    assert fitness.record.start_s == t[judged][0]
    assert said in next(finding.text for finding in fitness.findings if finding.code == "gaps")


def test_holes_that_leave_no_stretch():
    t = np.arange(N, dtype=float) + 1000.0 * (np.arange(N) // 50)
    assert refused(assess(cycling(time_s=t))) == ["gaps"]


def test_short_holes_are_filled_and_counted():
    keep = np.ones(N, dtype=bool)
    keep[10:14] = keep[200:202] = False
    full = cycling()
    fitness = assess(Recording("loop", full.time_s[keep], full.pv[keep], full.op[keep]))
    assert fitness.record.samples == N
    assert fitness.filled_share == pytest.approx(6 / N)
    assert outcomes(fitness)["irregular_sampling"] == "fail"
    assert fitness.auditable


def test_a_record_that_is_mostly_filling_is_refused():
    t = np.cumsum(np.where(np.arange(N) % 4 == 0, 6.0, 1.0))
    fitness = assess(cycling(time_s=t), FitnessConfig(max_filled_share=0.05))
    assert refused(fitness) == ["filled"]


def test_samples_at_random_times_are_put_on_a_grid_that_they_can_fill():
    t = np.cumsum(np.random.default_rng(6).exponential(size=N))
    recording = cycling(time_s=t, pv=np.sin(t / 20), op=np.cos(t / 20))
    fitness = assess(recording)
    assert fitness.auditable
    assert fitness.filled_share < 0.3
    assert fitness.record.sampling_interval_s == pytest.approx(2.0, rel=0.2)
    times = t[0] + fitness.record.sampling_interval_s * np.arange(fitness.record.samples)
    np.testing.assert_allclose(fitness.record.pv, np.sin(times / 20), atol=0.05)


def test_the_least_interval_of_a_stretch_makes_no_endless_grid():
    """Stamps a microsecond apart, in half of hours of ten seconds: 1.2e10 points."""
    rng = np.random.default_rng(0)
    before = np.arange(0.0, 20_000.0, 10.0)
    after = np.sort(30_000.0 + np.r_[np.arange(0.0, 12_000.0, 10.0), 5.0 + 1e-6 * np.arange(1400)])
    time_s = np.concatenate((before, after))
    values = rng.normal(size=len(time_s))
    fitness = assess(Recording("L", time_s, values, np.cumsum(values)))
    assert fitness.record is not None
    assert fitness.record.samples == len(after) // 2


@pytest.mark.parametrize("jump_at", [100, 199])
def test_set_point_holds_until_it_steps(jump_at):
    """A straight line over a hole, or between stamps that do not meet the grid, would give set points of nobody."""
    keep = ~np.isin(np.arange(N), [10, 11, 12, 97, 98, 99])
    sp = np.where(np.arange(N) < jump_at, 20.0, 30.0)
    full = cycling(sp=np.where(np.arange(N) % 3 == 1, sp, np.nan))
    fitness = assess(Recording("loop", full.time_s[keep] / 3.0, full.pv[keep], full.op[keep], full.sp[keep]))
    assert fitness.record.samples == N
    assert np.array_equal(fitness.record.sp, np.where(np.arange(N) < jump_at, 20.0, 30.0))


def test_late_scans_are_taken_as_they_are():
    t = np.arange(N, dtype=float) + np.random.default_rng(2).uniform(-0.05, 0.05, N)
    recording = cycling(time_s=t)
    fitness = assess(recording)
    np.testing.assert_array_equal(fitness.record.pv, recording.pv)
    assert fitness.record.sampling_interval_s == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    "stamps",
    [
        np.floor(3.3 * np.arange(N)),  # of a scan each 3.3 s, in whole seconds
        np.arange(N) + np.random.default_rng(2).uniform(-0.4, 0.4, N),
        np.arange(N) + 0.4 * (np.arange(N) == 200),
    ],
)
def test_one_stamp_a_tick_is_a_regular_scan_however_inexact(stamps):
    recording = cycling(time_s=stamps)
    fitness = assess(recording)
    assert outcomes(fitness)["irregular_sampling"] == "pass"
    assert fitness.filled_share == 0.0
    np.testing.assert_array_equal(fitness.record.pv, recording.pv)


@pytest.mark.parametrize("stamps", [np.arange(N) + (np.arange(N) >= 200), 1.0 * np.delete(np.arange(N + 1), 399)])
def test_a_stamp_that_is_missing_is_none(stamps):
    fitness = assess(cycling(time_s=stamps))
    assert outcomes(fitness)["irregular_sampling"] == "fail"
    assert int(np.sum(fitness.record.filled)) == 1


@pytest.mark.parametrize(
    ("samples", "hole", "gaps"),
    [(400, 19, 0), (400, 22, 1), (100, 10, 0), (100, 11, 1), (2000, 39, 0), (2000, 42, 1)],
)
def test_a_hole_is_filled_that_is_short_beside_the_record(samples, hole, gaps):
    keep = np.ones(samples, dtype=bool)
    keep[samples // 2 : samples // 2 + hole - 1] = False
    fitness = assess(cycling(samples).part(keep), FitnessConfig(min_samples=20))
    assert fitness.gaps == gaps
    assert gaps or fitness.audited.samples == samples


def test_signals_stamped_at_different_times_are_brought_together():
    good, rows = cycling(), np.arange(N)
    pv = np.where(rows % 2 == 0, good.pv, np.nan)
    op = np.where(rows % 4 == 1, good.op, np.nan)
    fitness = assess(cycling(pv=pv, op=op))
    assert fitness.auditable
    assert (fitness.record.samples, fitness.record.sampling_interval_s) == (N // 4, 4.0)
    np.testing.assert_array_equal(fitness.record.op, good.op[1::4])
    np.testing.assert_allclose(fitness.record.pv, (good.pv[0:-2:4] + good.pv[2::4]) / 2)
    assert "PV is interpolated" in fitness.findings[1].text


def test_signals_that_never_overlap_in_time_are_not_brought_together():
    good, rows = cycling(), np.arange(N)
    fitness = assess(cycling(pv=np.where(rows < 200, good.pv, np.nan), op=np.where(rows >= 200, good.op, np.nan)))
    assert refused(fitness) == ["missing_values"]


def test_set_point_with_holes_is_completed_and_one_without_values_is_none():
    sp = np.full(N, 20.0)
    sp[5:50] = np.nan
    assert np.all(assess(cycling(sp=sp)).record.sp == 20.0)
    assert assess(cycling(sp=np.full(N, np.nan))).record.sp is None


def test_a_signal_that_begins_later_than_the_other_is_not_made_up_before():
    """PV on the odd seconds from 301 on, OP on every fourth from 0 on."""
    at, whole = np.arange(1000), cycling(1000)
    pv = np.where((at % 2 == 1) & (at > 300), whole.pv, np.nan)
    op = np.where(at % 4 == 0, whole.op, np.nan)
    record = assess(cycling(1000, pv=pv, op=op)).record
    assert (record.start_s, record.sampling_interval_s, record.samples) == (304.0, 4.0, 174)


def test_the_newest_long_stretch_between_two_holes_is_taken():
    config = FitnessConfig(max_gap_intervals=3.0, newest_share=0.5, min_samples=4)
    time_s = np.array([0.0, 1, 2, 3, 4, 5, 6, 7, 20, 21, 22, 23, 40, 41])
    found = newest_without_hole(time_s, config)
    assert (found.samples, found.holes) == (slice(8, 12), 2)
    whole = newest_without_hole(time_s[:8], config)
    assert (whole.samples, whole.holes) == (slice(0, 8), 0)


@pytest.mark.parametrize("interval_s", [1.0, 0.1, 1 / 60, 0.3, 60.0])
@pytest.mark.parametrize("starts_s", [0.0, 12345.6, 1.7e9])
def test_the_unit_of_time_makes_no_hole(interval_s: float, starts_s: float):
    if interval_s < 1.0 and starts_s > 1e9:  # a stamp has seven digits behind the point then
        starts_s = 1e6
    ticks = np.delete(np.arange(N), slice(200, 209))  # ten intervals, as many as are filled
    fitness = assess(cycling(len(ticks), time_s=starts_s + interval_s * ticks))
    assert (fitness.gaps, fitness.record.samples, int(np.sum(fitness.record.filled))) == (0, N, 9)
