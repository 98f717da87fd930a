"""Whether a record can be audited: literal records, one a finding, and what must not change the answer."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.engine.fitness import FitnessConfig, assess, with_cycles
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import Recording
from tests.engine.cycling_loop import N, cycling, outcomes, refused


def test_good_record_passes_every_check_and_is_kept_as_it_is():
    recording = cycling(automatic=np.ones(N, dtype=bool))
    fitness = assess(recording)
    assert fitness.auditable
    told = outcomes(fitness)
    assert told.pop("time_skew") == "not_evaluated"  # its OP is none of a controller
    assert set(told.values()) == {"pass"}
    np.testing.assert_array_equal(fitness.record.pv, recording.pv)
    assert (fitness.record.sampling_interval_s, fitness.filled_share, fitness.record.start_s) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("n", [0, 1, 3, 99])
def test_too_short(n):
    fitness = assess(cycling(n))
    assert refused(fitness) == ["too_short"]
    assert (fitness.record, fitness.gaps, fitness.filled_share) == (None, 0, None)
    assert outcomes(fitness)["pv_flat"] == "not_evaluated"


def test_missing_values_everywhere():
    fitness = assess(cycling(pv=np.full(N, np.nan)))
    assert refused(fitness) == ["missing_values"]
    assert fitness.missing_share == 1.0


@pytest.mark.parametrize("marker", [np.nan, np.inf, -np.inf, 1e300, 3.4e123])
def test_bad_value_markers_are_missing_and_filled(marker):
    good = cycling()
    pv = good.pv.copy()
    pv[100:104] = marker
    fitness = assess(cycling(pv=pv))
    assert fitness.auditable
    assert np.flatnonzero(fitness.record.filled).tolist() == [100, 101, 102, 103]
    np.testing.assert_allclose(fitness.record.pv[100:104], np.interp([1, 2, 3, 4], [0, 5], good.pv[[99, 104]]))


def test_flat_pv_is_a_stuck_valve_or_a_dead_transmitter():
    fitness = assess(cycling(pv=np.full(N, 4.2)))
    assert refused(fitness) == ["pv_flat"]
    (finding,) = fitness.refusals
    assert (finding.statistic, finding.threshold) == (1.0, 0.5)
    assert "dead transmitter" in finding.text


def test_flat_op_is_not_controlling():
    assert refused(assess(cycling(op=np.full(N, 4.2)))) == ["op_flat"]


def test_what_stands_before_a_transmitter_died_is_audited():
    pv = cycling().pv.copy()
    pv[150:] = pv[150]
    fitness = assess(cycling(pv=pv))
    assert fitness.auditable
    assert fitness.record.samples == 150
    (finding,) = (f for f in fitness.findings if f.code == "pv_flat")
    assert "150 samples in a row remain" in finding.text
    assert (finding.outcome, finding.operator) == ("pass", None)  # for more than 0.5 of the stretch it is dead


def test_a_stuck_half_period_does_not_refuse():
    """PV that stands still while OP travels is what a sticky valve does."""
    pv = np.repeat([1.0, 2.0, 1.5, 1.0], 100) + np.r_[np.zeros(350), np.linspace(0, 0.1, 50)]
    assert assess(cycling(pv=pv)).auditable


def test_not_in_automatic():
    manual = np.zeros(N, dtype=bool)
    manual[::2] = True
    fitness = assess(cycling(automatic=manual))
    assert refused(fitness) == ["not_in_automatic"]
    assert fitness.automatic_share == 0.5


@pytest.mark.parametrize(
    ("manual", "judged", "said"),
    [
        (slice(105, 130), (130, 400), "270 of them in a row; at least 100 in a row are needed"),
        (slice(215, 240), (240, 400), "160 of them in a row; at least 100 in a row are needed"),  # as it is now
        (slice(265, 290), (0, 265), "needed; the 135 samples after them are not used"),  # too few since
        (slice(300, 400), (0, 300), "needed; the 100 samples after them are not used"),
    ],
)
def test_the_newest_long_stretch_in_automatic_is_audited(manual: slice, judged: tuple[int, int], said: str):
    automatic = np.ones(N, dtype=bool)
    automatic[manual] = False
    fitness = assess(cycling(automatic=automatic))
    assert (fitness.record.start_s, fitness.record.start_s + fitness.record.samples) == judged
    text = next(finding.text for finding in fitness.findings if finding.code == "not_in_automatic")
    assert said in text
    assert text.endswith("not looked at") == said.endswith("not looked at")


@pytest.mark.parametrize("blips", [range(50, N, 90), [100, 300], range(200, 209)])
def test_a_mode_that_blinks_ends_no_stretch(blips):
    automatic = np.ones(N, dtype=bool)
    automatic[list(blips)] = False
    fitness = assess(cycling(automatic=automatic))
    assert (fitness.record.start_s, fitness.record.samples, fitness.gaps) == (0.0, N, 0)
    assert np.flatnonzero(fitness.record.filled).tolist() == list(blips)
    assert fitness.automatic_share == 1.0 - len(blips) / N


@pytest.mark.parametrize(
    "spell",
    [
        (1030, 1135, 4),  # each fourth sample blinks out: too few are in automatic
        (1050, 1950, 2),  # each second one: too many to fill
    ],
)
def test_a_stretch_that_blinks_is_as_long_as_what_is_in_automatic(spell):
    first, behind, every = spell
    automatic = np.arange(2000) < 200
    automatic[first:behind] = np.arange(first, behind) % every != 0
    fitness = assess(cycling(2000, automatic=automatic))
    assert fitness.auditable
    assert (fitness.record.start_s, fitness.record.samples) == (0.0, 200)


def test_a_blink_is_as_long_as_a_hole_that_is_filled():
    automatic, pv = np.ones(N, dtype=bool), cycling().pv.copy()
    automatic[200:209], pv[200:209] = False, np.nan
    by_mode, by_hole = assess(cycling(automatic=automatic)), assess(cycling(pv=pv))
    np.testing.assert_array_equal(by_mode.record.pv, by_hole.record.pv)


def test_beside_a_dead_op_the_newest_long_stretch_is_audited():
    op = cycling(1000).op
    op[250:750] = op[250]
    fitness = assess(cycling(1000, op=op))
    assert (fitness.record.start_s, fitness.record.samples) == (750.0, 250)


def test_mode_that_was_not_recorded_is_not_evaluated():
    fitness = assess(cycling())
    assert outcomes(fitness)["not_in_automatic"] == "not_evaluated"
    assert fitness.automatic_share is None


@pytest.mark.parametrize("op_range", [(0.0, 100.0), (100.0, 0.0), None])
def test_op_at_its_limit(op_range):
    op = np.where(np.arange(N) % 40 < 25, 0.0, 10.0 + np.arange(N) % 7)
    assert refused(assess(cycling(op=op, op_range=op_range))) == ["op_at_limits"]


@pytest.mark.parametrize("unit", [1.0, -0.16])
def test_op_that_is_switched_is_refused_as_on_off_control(unit):
    op = unit * np.where(np.arange(N) % 40 < 15, 100.0, 0.0)
    fitness = assess(cycling(op=op))
    assert refused(fitness) == ["op_two_values"]
    assert fitness.refusals[0].statistic == 1.0
    ramps = np.convolve(op, np.ones(2) / 2, "same")  # values between, for one sample of forty
    assert refused(assess(cycling(op=ramps))) == ["op_two_values"]


def test_op_that_is_switched_is_refused_under_noise_and_beside_single_values():
    """As a read-back has it, and by hand for a moment."""
    noise = np.random.default_rng(1).standard_normal(N)
    switched = np.where(np.arange(N) % 40 < 15, 80.0, 20.0)
    for op in (switched + 0.1 * noise, np.where(np.arange(N) == 70, 100.0, switched)):
        assert refused(assess(cycling(op=op))) == ["op_two_values"]


@pytest.mark.parametrize("switches", [1, 2, 5])
def test_op_that_a_load_or_a_set_point_moves_between_two_levels_is_not_switched(switches):
    noise = np.random.default_rng(1).standard_normal(N)
    op = np.where(np.arange(N) * (switches + 1) // N % 2 == 1, 60.0, 40.0)
    assert "op_two_values" not in refused(assess(cycling(op=op + 0.05 * noise)))


def test_op_that_runs_up_and_down_within_a_fifth_of_its_extremes_is_not_switched():
    phase = np.arange(N) % 40 / 40.0
    op = np.where(phase < 0.5, 100.0, 0.0) + np.where(phase < 0.5, -1.0, 1.0) * 30.0 * np.abs(
        2.0 * (2.0 * phase % 1.0) - 1.0
    )
    assert "op_two_values" not in refused(assess(cycling(op=op)))


def test_op_that_a_controller_runs_from_limit_to_limit_is_not_switched():
    """A level at its limit of stability: OP is at its limits for nine tenths, and takes its way between them."""
    swing = np.sin(2.0 * np.pi * np.arange(N) / 80.0)
    op = 50.0 + np.clip(400.0 * swing, -50.0, 50.0)
    assert np.mean((op == 0.0) | (op == 100.0)) > 0.9
    assert "op_two_values" not in refused(assess(cycling(op=op)))
    assert refused(assess(cycling(op=np.where(swing > 0.0, 100.0, 0.0)))) == ["op_two_values"]


def test_op_in_triangles_and_in_steps_of_its_own_is_not_switched():
    phase = np.arange(N) % 40 / 40.0
    for op in (np.abs(2.0 * phase - 1.0), np.round(6.0 * np.abs(2.0 * phase - 1.0))):
        assert "op_two_values" not in refused(assess(cycling(op=10.0 * op)))


def test_op_that_is_at_its_limit_but_for_moments_is_not_switched():
    op = np.where(np.arange(N) % 40 < 1, 100.0, 0.0)
    assert refused(assess(cycling(op=op))) == ["op_at_limits"]


def test_op_that_saturates_now_and_then_is_audited():
    op = np.maximum(cycling().op, 48.0)
    assert assess(cycling(op=op)).auditable


def test_op_range_without_meaning_is_ignored():
    assert assess(cycling(op_range=(0.0, 0.0))).auditable
    assert assess(cycling(op_range=(np.nan, 100.0))).auditable


def test_coarse_and_interpolated_signals_are_said_but_audited():
    t = np.arange(N)
    pv = np.round(2 * np.sin(2 * np.pi * t / 40))
    op = np.interp(t, t[::8], cycling().op[::8])
    fitness = assess(cycling(pv=pv, op=op))
    assert fitness.auditable
    failed = [code for code, outcome in outcomes(fitness).items() if outcome == "fail"]
    assert failed == ["pv_quantised", "op_interpolated"]


def test_too_few_samples_a_cycle():
    t = np.arange(N)
    recording = cycling(pv=np.sin(2 * np.pi * t / 3.4), op=np.cos(2 * np.pi * t / 3.4))
    fitness = assess(recording)
    checked = with_cycles(fitness, detect(fitness.record))
    assert refused(checked) == ["samples_per_cycle"]


def test_noise_without_a_period_is_not_refused_for_its_period():
    noise = np.random.default_rng(3).normal(size=(2, N))
    fitness = assess(cycling(pv=noise[0], op=noise[1]))
    assert with_cycles(fitness, detect(fitness.record)).auditable


def test_cycles_are_counted():
    fitness = assess(cycling())
    checked = with_cycles(fitness, detect(fitness.record))
    cycles = next(f for f in checked.findings if f.code == "few_cycles")
    assert cycles.outcome == "pass"
    assert cycles.statistic == pytest.approx(10, rel=0.02)


@pytest.mark.parametrize(("every", "outcome"), [(1, "pass"), (10, "fail")])
def test_points_that_a_historian_stored_are_counted_in_a_cycle(every, outcome):
    t = np.arange(N)
    known = t[::every]
    pv = np.interp(t, known, np.sin(2 * np.pi * known / 40 + 0.3))
    fitness = assess(cycling(pv=pv))
    checked = with_cycles(fitness, detect(fitness.record))
    stored = next(f for f in checked.findings if f.code == "stored_points")
    assert stored.outcome == outcome
    assert stored.statistic == pytest.approx(40 / every, rel=0.1)


def test_thresholds_come_from_the_configuration():
    assert assess(cycling(90), FitnessConfig(min_samples=80)).auditable


def test_inputs_are_not_changed():
    recording = cycling(pv=np.where(np.arange(N) == 7, np.nan, cycling().pv))
    before = recording.fingerprint()
    assess(recording)
    assert recording.fingerprint() == before


def test_every_code_is_reported_once_whatever_stopped_the_checks():
    good = assess(cycling())
    every = set(outcomes(with_cycles(good, detect(good.record))))
    short = Recording("x", np.arange(3.0), np.arange(3.0), np.arange(3.0))
    gaps = cycling(time_s=np.arange(N) + 1000.0 * (np.arange(N) // 50))
    manual = cycling(automatic=np.zeros(N, dtype=bool))
    for recording in (short, gaps, manual, cycling(pv=np.full(N, np.nan)), cycling(pv=np.zeros(N))):
        fitness = with_cycles(assess(recording), None)
        codes = [finding.code for finding in fitness.findings]
        assert len(codes) == len(set(codes))
        assert set(codes) == every


units = st.tuples(
    st.floats(1e-6, 1e6) | st.floats(-1e6, -1e-6), st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.floats(-1e9, 1e9)
)


@settings(max_examples=40)
@given(pv_unit=units, op_unit=units, flaw=st.sampled_from(["none", "flat", "limit", "hole", "nan", "coarse"]))
def test_units_signs_offsets_and_the_origin_of_time_change_no_finding(pv_unit, op_unit, flaw):
    base = cycling()
    t, pv, op = base.time_s.copy(), base.pv.copy(), base.op.copy()
    if flaw == "flat":
        pv[100:] = pv[100]
    elif flaw == "limit":
        op = np.maximum(op, 51.0)
    elif flaw == "hole":
        t[300:] += 500
    elif flaw == "nan":
        op[::9] = np.nan
    elif flaw == "coarse":
        pv = np.round(pv * 8) / 8

    def scaled(x, unit):
        # An offset in units of the scaled signal, as a change of unit would bring it.
        return x * unit[0] + unit[1] * abs(unit[0])

    plain = assess(Recording("a", t, pv, op, op_range=(0.0, 100.0)))
    low, high = scaled(np.array([0.0, 100.0]), op_unit)
    other = assess(Recording("a", t + 1e5, scaled(pv, pv_unit), scaled(op, op_unit), op_range=(low, high)))
    assert outcomes(plain) == outcomes(other)
    statistics = [[f.statistic for f in x.findings if not f.code.endswith("quantised")] for x in (plain, other)]
    assert statistics[0] == statistics[1]


@settings(max_examples=60)
@given(
    st.lists(st.floats(allow_nan=True, allow_infinity=True, width=64), min_size=0, max_size=30),
    st.integers(0, 12),
)
def test_whatever_is_recorded_is_answered(values, repeats):
    signal = np.array(values * (repeats + 1), dtype=float)
    fitness = assess(Recording("x", np.arange(len(signal)), signal, signal[::-1].copy()))
    if fitness.record is not None:
        assert np.all(np.isfinite(fitness.record.pv))
        assert np.all(np.isfinite(fitness.record.op))


def test_the_period_of_noise_is_no_reason_to_refuse():
    """It is two samples, whatever the sampling interval."""
    fitness = assess(cycling())
    noise = Oscillation(2.0, 0.5, 0.1, 2.0, 200.0, "pv", 0.0)
    assert outcomes(with_cycles(fitness, noise))["samples_per_cycle"] == "not_evaluated"
    assert outcomes(with_cycles(fitness, replace(noise, regularity=1.5)))["samples_per_cycle"] == "fail"
