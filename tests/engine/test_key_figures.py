"""Key figures on signals whose answer is known in the head."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from app.engine.audit import AuditConfig, audit
from app.engine.fitness import FitnessConfig
from app.engine.key_figures import compute
from app.engine.recording import Recording


def recording(op, pv=None, sp=None, automatic=None, op_range=None, interval_s=1.0):
    op = np.asarray(op, dtype=float)
    pv = np.asarray(op if pv is None else pv, dtype=float)
    return Recording("loop", np.arange(len(op)) * interval_s, pv, op, sp, automatic, op_range)


def test_triangle_travels_its_height_each_way():
    op = np.concatenate([np.arange(0, 10), np.arange(10, 0, -1)] * 5 + [[0.0]])
    figures = compute(recording(op, interval_s=36.0))
    assert figures.op_travel_per_h == pytest.approx(100.0)
    assert figures.op_reversals_per_h == pytest.approx(9.0)


def test_ripple_below_the_band_is_no_travel():
    op = np.linspace(0.0, 100.0, 1001) + 0.5 * np.tile([0.0, 1.0], 501)[:1001]
    figures = compute(recording(op))
    assert figures.op_reversals_per_h == 0.0
    assert figures.op_travel_per_h == pytest.approx(100.4 * 3.6, rel=0.02)


def test_error_service_factor_and_saturation_use_good_samples_in_automatic():
    pv = np.array([1.0, 2.0, np.nan, 4.0, 9.0])
    automatic = np.array([True, True, True, True, False])
    figures = compute(recording([0, 100, 50, 50, 100], pv, np.full(5, 3.0), automatic, (0.0, 100.0)))
    assert figures.good_share_pct == pytest.approx(80.0)
    assert figures.service_factor_pct == pytest.approx(75.0)
    assert figures.op_saturation_pct == pytest.approx(200.0 / 3.0)
    assert (figures.error_mean, figures.error_abs_mean) == pytest.approx((2.0 / 3.0, 4.0 / 3.0))


def test_harris_index_is_one_for_white_noise_and_small_for_an_oscillation():
    rng = np.random.default_rng(1)
    noise, t = rng.normal(size=4000), np.arange(4000)
    swinging = np.sin(2 * np.pi * t / 60.0) + 0.1 * noise
    assert compute(recording(t, noise, np.zeros(4000))).harris_index == pytest.approx(1.0, abs=0.05)
    assert compute(recording(t, swinging, np.zeros(4000))).harris_index < 0.1


def test_no_harris_index_of_a_pv_that_a_historian_drew():
    """Of a loop that cannot be controlled better every tenth sample was kept: 0.15 by what was drawn between them."""
    noise, t = np.random.default_rng(1).normal(size=4000), np.arange(4000.0)
    kept = np.arange(0, 4000, 10)
    assert compute(recording(t, np.interp(t, kept, noise[kept]), np.zeros(4000))).harris_index is None


def test_what_cannot_be_had_is_none():
    figures = compute(recording([1.0, 1.0, 1.0]))
    assert figures.service_factor_pct is None
    assert figures.op_saturation_pct is None
    assert figures.error_mean is None
    assert figures.harris_index is None
    assert compute(recording([np.nan, np.nan])).op_travel_per_h is None


@pytest.mark.parametrize("move", [np.nextafter(20.0, 21.0) - 20.0, -3e-15])
def test_what_moves_by_a_rounding_alone_stands(move):
    pv = np.full(300, 20.0)
    pv[5] += move
    figures = compute(recording(np.arange(300.0), pv, np.full(300, 10.0)))
    assert (figures.harris_index, figures.response_time_s) == (None, None)


def test_a_signal_whose_square_is_nothing():
    noise = 1e-200 * np.random.default_rng(1).normal(size=400)
    figures = compute(recording(np.arange(400.0), noise))
    assert (figures.harris_index, figures.response_time_s) == (None, None)


def half_of_the_time_in_automatic():
    """Six hours in automatic, a sample every ten minutes, then six in manual, a sample a second."""
    time_s = np.concatenate((600.0 * np.arange(36), 21600.0 + np.arange(21600.0)))
    automatic = time_s < 21600.0
    pv, op = np.where(automatic, 1.0, 3.0), np.where(automatic, 100.0, 50.0)
    return Recording("loop", time_s, pv, op, np.full(len(pv), 2.0), automatic, (0.0, 100.0))


def test_figures_are_of_time_whatever_the_number_of_samples():
    uneven = half_of_the_time_in_automatic()
    figures = compute(uneven)
    assert figures.service_factor_pct == pytest.approx(50.0)
    assert (figures.pv_std, figures.op_std) == pytest.approx((1.0, 25.0))

    figures = compute(replace(uneven, automatic=None))
    assert (figures.op_saturation_pct, figures.error_mean) == pytest.approx((50.0, 0.0), abs=1e-9)
    assert (figures.error_p05, figures.error_p95, figures.error_std) == pytest.approx((-1.0, 1.0, 1.0))
    assert compute(replace(uneven, op_range=None, automatic=None)).op_at_extreme_pct is None  # of two values only


def test_time_at_an_extreme_is_time():
    time_s = np.concatenate((np.arange(500.0), 500.0 + 10.0 * np.arange(50)))
    op = np.concatenate((np.linspace(0.0, 49.0, 500), np.full(50, 50.0)))
    assert compute(Recording("loop", time_s, op, op)).op_at_extreme_pct == pytest.approx(50.0, abs=1.0)


@pytest.mark.parametrize("span", [(0.0, 0.0), (-np.inf, 100.0), (np.nan, 100.0), (0.0, np.nan), (-1e308, 1e308)])
def test_a_span_that_is_none_is_not_known(span):
    op = np.linspace(40.0, 60.0, 200)
    figures = compute(Recording("loop", np.arange(200.0), op, op, np.zeros(200), op_range=span, pv_range=span))
    assert (figures.op_saturation_pct, figures.op_at_extreme_pct) == (None, pytest.approx(0.5))
    assert (figures.error_abs_mean_pct_of_span, figures.op_travel_pct_of_span_per_h) == (None, None)


def test_a_span_may_be_told_the_other_way_round():
    op = np.repeat([100.0, 50.0, 0.2, 50.0], 50)
    there, back = (compute(recording(op, sp=np.zeros(200), op_range=span)) for span in ((0.0, 100.0), (100.0, 0.0)))
    assert there == back
    assert there.op_saturation_pct == pytest.approx(50.0)


def alternating(automatic=None, holes=()):
    """Error that repeats itself every 20 samples, in stretches of 200 that begin anywhere in it."""
    rng = np.random.default_rng(5)
    pattern = rng.normal(size=20)
    pv = np.concatenate([np.tile(pattern, 11)[k : k + 200] for k in rng.integers(0, 20, 20)])
    time_s = np.arange(4000.0)
    for hole in holes:
        time_s[hole:] += 1000.0
    return Recording("loop", time_s, pv + 1e-3 * rng.normal(size=4000), pv, np.zeros(4000), automatic)


def test_the_harris_index_does_not_look_across_holes_and_spells_in_manual():
    """What repeats itself is foretold whole, except where ends are joined that do not belong together."""
    joined = compute(alternating()).harris_index
    apart = compute(alternating(holes=range(200, 4000, 200))).harris_index
    spells = Recording(**{**vars(alternating()), "automatic": np.arange(4000) % 200 < 199})
    assert joined > 0.05
    assert apart < 1e-3
    assert compute(spells).harris_index < 1e-3


def test_no_harris_index_of_runs_that_are_too_short():
    noise = np.random.default_rng(1).normal(size=4000)
    automatic = np.arange(4000) % 25 < 24
    assert compute(recording(noise, noise, np.zeros(4000), automatic)).harris_index is None


@given(st.floats(0.01, 1e4), st.floats(-1e3, 1e3), st.integers(0, 1000))
def test_travel_scales_with_op_and_ignores_its_zero(scale, offset, seed):
    op = np.cumsum(np.random.default_rng(seed).normal(size=300))
    one, other = compute(recording(op)), compute(recording(scale * op + offset))
    assert other.op_travel_per_h == pytest.approx(scale * one.op_travel_per_h, rel=1e-6)
    assert other.op_reversals_per_h == one.op_reversals_per_h


def test_the_distribution_of_the_control_error():
    n = 1000
    error = np.linspace(-1.0, 3.0, n)
    figures = compute(
        Recording("x", np.arange(n, dtype=float), -error, np.zeros(n), sp=np.zeros(n), pv_range=(0.0, 50.0))
    )
    assert figures.error_p05 == pytest.approx(-0.8, abs=0.01)
    assert figures.error_median == pytest.approx(1.0, abs=0.01)
    assert figures.error_p95 == pytest.approx(2.8, abs=0.01)
    assert figures.error_abs_mean_pct_of_span == pytest.approx(100 * figures.error_abs_mean / 50.0)


def test_an_upset_of_a_first_order_loop_is_felt_for_its_time_constant():
    """An autoregression with pole exp(-Ts/tau) has the autocorrelation exp(-t/tau): 1/e at tau."""
    rng = np.random.default_rng(3)
    error = lfilter([1.0], [1.0, -np.exp(-2.0 / 60.0)], rng.normal(size=40_000))
    figures = compute(Recording("x", 2.0 * np.arange(40_000), -error, np.zeros(40_000), sp=np.zeros(40_000)))
    assert figures.response_time_s == pytest.approx(60.0, rel=0.15)


def test_travel_in_per_cent_of_the_span():
    op = np.tile([40.0, 60.0], 500)
    figures = compute(Recording("x", np.arange(1000.0), np.zeros(1000), op, op_range=(0.0, 200.0)))
    assert figures.op_travel_pct_of_span_per_h == pytest.approx(figures.op_travel_per_h / 2.0)
    assert compute(Recording("x", np.arange(1000.0), np.zeros(1000), op)).op_travel_pct_of_span_per_h is None


def test_time_that_was_not_recorded_is_no_time_in_which_op_rested():
    op = np.tile([0.0, 10.0], 360)
    whole = compute(recording(op, interval_s=10.0))
    with_hole = Recording("loop", np.arange(720.0) * 10.0 + np.where(np.arange(720) < 360, 0.0, 79_200.0), op, op)
    lost = np.where((np.arange(7200) < 360) | (np.arange(7200) >= 6840), np.tile(op, 10), np.nan)
    for it in (with_hole, recording(lost, interval_s=10.0)):
        assert compute(it).op_travel_per_h == pytest.approx(whole.op_travel_per_h, rel=0.02)
        assert compute(it).op_reversals_per_h == pytest.approx(whole.op_reversals_per_h, rel=0.02)


def test_an_upset_lasts_as_long_however_unevenly_it_was_stored():
    rng = np.random.default_rng(5)
    time_s = np.cumsum(np.where(rng.random(4000) < 0.6, 10.0, 40.0))
    disturbance = lfilter([1.0], [1.0, -0.9], rng.normal(size=4000))
    uneven = Recording("loop", time_s, disturbance, np.arange(4000.0), np.zeros(4000))
    even = replace(uneven, time_s=22.0 * np.arange(4000))
    assert compute(uneven).response_time_s == pytest.approx(compute(even).response_time_s, rel=0.05)


def test_what_op_did_while_nothing_was_recorded_is_no_travel():
    op = np.repeat([20.0, 80.0], 60)
    time_s = 10.0 * np.arange(120.0) + np.where(np.arange(120) < 60, 0.0, 86_400.0)
    figures = compute(Recording("loop", time_s, op, op))
    assert (figures.op_travel_per_h, figures.op_reversals_per_h) == (0.0, 0.0)
    ends = np.where((np.arange(500) == 0) | (np.arange(500) == 499), 1.0, np.nan)
    assert compute(recording(np.linspace(0.0, 50.0, 500), ends)).op_travel_per_h is None


def apart(n: int = 600) -> tuple[Recording, Recording]:
    """A loop whose PV and OP were taken at one time, and the same stamped by turns, SP beside PV."""
    k = np.arange(n, dtype=float)
    pv, op = 20.0 + np.sin(k / 20.0), 50.0 + 5.0 * np.cos(k / 20.0)
    together = Recording("loop", k, pv, op, np.full(n, 20.5), np.ones(n, bool), (0.0, 100.0), (0.0, 50.0))
    by_turns = {name: np.full(2 * n, np.nan) for name in ("pv", "op", "sp")}
    by_turns["pv"][::2], by_turns["op"][1::2], by_turns["sp"][::2] = pv, op, together.sp
    return together, replace(together, time_s=np.arange(2 * n) / 2.0, automatic=np.ones(2 * n, bool), **by_turns)


def test_signals_that_were_stamped_by_turns_have_the_figures_of_their_loop():
    one, other = (compute(loop) for loop in apart())
    assert other.good_share_pct == pytest.approx(100.0, abs=0.5)
    for name in ("error_abs_mean", "error_mean", "pv_std", "op_std", "op_travel_per_h", "service_factor_pct"):
        assert getattr(other, name) == pytest.approx(getattr(one, name), rel=0.02), name
    assert other.response_time_s == pytest.approx(one.response_time_s, abs=1.0)


def test_a_wild_sample_moves_no_figure():
    loop, _ = apart()
    op = loop.op.copy()
    op[300] = 4294967295.0
    figures = compute(replace(loop, op=op))
    assert figures.op_std == pytest.approx(compute(loop).op_std, rel=0.01)
    assert figures.good_share_pct == pytest.approx(100.0 * 599 / 600)


def test_a_hole_is_what_the_audit_takes_for_one():
    """OP moves by 100 within eight intervals of which nothing is known."""
    k = np.arange(60)
    loop = Recording("loop", k + 7.0 * (k >= 30), np.sin(k), np.where(k < 30, 0.0, 100.0))
    assert compute(loop).op_travel_per_h == pytest.approx(100.0 / (66.0 / 3600.0))
    short = FitnessConfig(max_gap_intervals=3.0)
    assert compute(loop, short).op_travel_per_h == 0.0
    assert audit(loop, AuditConfig(fitness=short)).key_figures == compute(loop, short)


def test_a_value_holds_over_no_more_than_the_audit_fills():
    """PV is at 1 before 8 intervals of which nothing is known, and at 0 else."""
    k = np.arange(60)
    loop = Recording("loop", k + 7.0 * (k >= 30), np.where(k == 29, 1.0, 0.0), np.sin(k))
    for most, held in ((10.0, 8.0), (3.0, 3.0)):
        share = held / (59.0 + held)
        std = compute(loop, FitnessConfig(max_gap_intervals=most)).pv_std
        assert std == pytest.approx(np.sqrt(share * (1.0 - share)))


def test_what_a_historian_drew_is_what_the_audit_takes_for_it():
    t, noise = np.arange(4000), np.random.default_rng(0).normal(size=4000)
    kept = np.arange(0, 4000, 10)
    drawn = recording(t, np.interp(t, kept, noise[kept]), np.zeros(4000))
    assert compute(drawn, FitnessConfig(max_on_line_share=1.0)).harris_index is not None
