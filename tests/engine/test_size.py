"""The size of stiction: found on limit cycles whose S is known, refused where the record does not tell."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.oscillation import detect
from app.engine.quantification import QuantificationConfig, quantify
from app.engine.quantification.kernel import residuals
from app.engine.quantification.quantify import lively_range
from app.engine.recording import UniformRecord
from app.engine.simulate import LinearValve, LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop
from app.engine.valve import he_stems, kano_stems, two_parameter_he, two_parameter_kano

_STICKY = LoopSpec(
    plant=first_order(1.0, 10.0, 2.0),
    controller=Pid(0.8, 10.0),
    valve=TwoParameterValve(4.0, 1.6),
    load=Signal(value=2.5, noise_sd=0.1, noise_tau_s=60.0),
    noise=Signal(noise_sd=0.015),
    settle_s=600.0,
)


def size_of(spec, seed=1, **changes):
    record = simulate_loop(spec, 1500.0, 1.0, seed).uniform()
    return quantify(replace(record, **changes), detect(record))


@pytest.fixture(scope="module")
def size():
    return size_of(_STICKY)


def test_S_of_a_limit_cycle_is_found(size):
    assert size.identifiable
    assert abs(size.S - (4.0)) <= 0.15 * abs(4.0)
    assert size.interval(95.0).low < 4.0 < size.interval(95.0).high


def test_an_interval_that_is_not_stated_is_a_wrong_key(size):
    with pytest.raises(KeyError):
        size.interval(90.0)


def test_intervals_are_nested_around_S(size):
    lows, highs = [i.low for i in size.S_intervals], [i.high for i in size.S_intervals]
    assert [i.level_pct for i in size.S_intervals] == [50.0, 80.0, 95.0]
    assert lows == sorted(lows, reverse=True)
    assert highs == sorted(highs)
    assert lows[0] < size.S < highs[0]


@pytest.mark.parametrize("form", ["choudhury", "kano"])
def test_S_of_other_valve_models_is_found(form):
    found = size_of(replace(_STICKY, valve=TwoParameterValve(4.0, 1.0, form)))
    assert abs(found.S - (4.0)) <= 0.2 * abs(4.0)


def test_S_grows_with_the_valve(size):
    larger = replace(_STICKY, valve=TwoParameterValve(8.0, 3.2), load=Signal(value=5.0, noise_sd=0.2, noise_tau_s=60.0))
    found = size_of(replace(larger, noise=Signal(noise_sd=0.03)))
    assert abs(found.S / size.S - (2.0)) <= 0.02 * abs(2.0)


def test_unit_offset_and_sign_change_only_the_unit_of_the_answer(size):
    record = simulate_loop(_STICKY, 1500.0, 1.0, 1).uniform()
    other = quantify(replace(record, pv=-3e4 * record.pv + 7.0, op=0.02 * record.op - 5.0), detect(record))
    turned = quantify(replace(record, op=100.0 - record.op), detect(record))
    assert abs(other.S - (0.02 * size.S)) <= 1e-6 * abs(0.02 * size.S)
    assert abs(turned.S - (size.S)) <= 1e-6 * abs(size.S)
    assert other.interval().low == pytest.approx(0.02 * size.interval().low, rel=1e-6)


def test_a_linear_loop_has_no_size():
    shaken = replace(_STICKY, valve=LinearValve(), load=Signal(noise_sd=3.0, noise_tau_s=30.0))
    found = size_of(shaken)
    assert not found.identifiable
    assert "size_evidence" in [f.code for f in found.findings if f.outcome == "fail"]


def test_what_a_historian_rebuilt_is_not_sized():
    record = simulate_loop(_STICKY, 1500.0, 1.0, 1).uniform()
    found = quantify(record, detect(record), as_sampled=False)
    assert [f.code for f in found.findings if f.outcome == "fail"] == ["size_as_sampled"]


def test_too_few_cycles_are_not_sized():
    record = simulate_loop(_STICKY, 1500.0, 1.0, 1).uniform()
    found = quantify(record, replace(detect(record), cycles=4.0))
    assert [f.code for f in found.findings if f.outcome == "fail"] == ["size_cycles"]


def test_nothing_to_size_gives_nothing():
    record = simulate_loop(_STICKY, 1500.0, 1.0, 1).uniform()
    oscillation = detect(record)
    flat = UniformRecord(1.0, np.ones(1500), record.op, None, record.filled)
    assert quantify(flat, oscillation) is None
    assert quantify(record, replace(oscillation, samples_per_cycle=None)) is None
    assert quantify(replace(record, pv=record.pv[:80], op=record.op[:80]), oscillation) is None


def test_samples_that_do_not_fit_the_thinning_change_little(size):
    """Ten times finer sampling is thinned to about the same record."""
    record = simulate_loop(replace(_STICKY, step_s=0.1), 1500.0, 0.1, 1).uniform()
    assert abs(quantify(record, detect(record)).S - (size.S)) <= 0.2 * abs(size.S)


def test_the_share_of_failures_widens_the_widest_interval_only():
    record = simulate_loop(_STICKY, 1500.0, 1.0, 1).uniform()
    sure = quantify(record, detect(record), config=QuantificationConfig(failure_share=0.0))
    unsure = quantify(record, detect(record), config=QuantificationConfig(failure_share=0.2))
    assert unsure.interval(95.0).low < sure.interval(95.0).low
    assert abs(unsure.S / sure.S - 1.0) < 0.05


def test_lively_range_is_over_four_of_five_cycles():
    op = np.concatenate([[0.0, k] for k in (1.0, 1.0, 1.0, 1.0, 1.0, 9.0)])
    assert lively_range(op, 2) == 1.0
    assert lively_range(np.array([0.0, 5.0]), 10) == 5.0


def test_stems_of_a_grid_move_as_the_valve_models_say():
    rng = np.random.default_rng(5)
    op = np.round(np.cumsum(rng.standard_normal(333)), 1)
    op[100:120] = op[100]
    S, J = np.repeat([0.0, 1.0, 4.0], 3), np.array([0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 0.0, 3.0, 5.0])
    for stems, model in ((he_stems, two_parameter_he), (kano_stems, two_parameter_kano)):
        v = np.empty((len(S), len(op)))
        means = stems(op, S, J, v)
        np.testing.assert_array_equal(v, model(op, S, J))
        np.testing.assert_allclose(means, v.mean(axis=1), rtol=1e-12)


@pytest.mark.parametrize("kano", [False, True])
@pytest.mark.parametrize("stride", [1, 2])
def test_a_stem_that_never_moves_explains_nothing(kano, stride):
    """Its mean is off its level by rounding; what is left of it must not become a regressor."""
    rng = np.random.default_rng(6)
    op, pv = 50.3 + 0.1 * rng.random(400 * stride), rng.standard_normal(400) + 0.3
    S = np.array([0.02, 1.0, 3.0])
    found = residuals(pv, op, stride, S, 0.5 * S, kano, 3, 4)
    first = 5 if stride == 1 else 4
    own = np.column_stack([pv[first - lag : len(pv) - lag] for lag in (1, 2, 3)])
    alone = np.linalg.lstsq(own, pv[first:], rcond=None)[1][0]
    np.testing.assert_allclose(found[1:], alone, rtol=1e-12)
    assert found[0] < alone


@pytest.mark.parametrize("valves", [1, 5, 32, 50])
def test_valves_abreast_are_valves_one_by_one(valves):
    rng = np.random.default_rng(6)
    op, pv = np.cumsum(rng.standard_normal(400)), rng.standard_normal(400)
    S = np.linspace(0.5, 6.0, valves)
    together = residuals(pv, op, 1, S, 0.5 * S, False, 3, 4)
    alone = [residuals(pv, op, 1, S[m : m + 1], 0.5 * S[m : m + 1], False, 3, 4)[0] for m in range(valves)]
    np.testing.assert_allclose(together, alone, rtol=1e-12)
    stem = two_parameter_he(op, S[-1:], 0.5 * S[-1:])[0]
    stem = stem - stem.mean()
    lags = np.column_stack([pv[5 - i : -i] for i in (1, 2, 3)] + [stem[5 - j : -j] for j in (1, 2, 3, 4)])
    left = pv[5:] - lags @ np.linalg.lstsq(lags, pv[5:], rcond=None)[0]
    np.testing.assert_allclose(together[-1], left @ left, rtol=1e-9)


def test_what_is_left_of_PV_moves_S_up_by_a_bounded_share():
    """Of the same record; the share of failures, which knows R alone, moves the median a little beside."""
    for noise_sd, least, most in ((0.002, 1.0, 1.03), (0.2, 1.05, 1.20)):
        record = simulate_loop(replace(_STICKY, noise=Signal(noise_sd=noise_sd)), 1500.0, 1.0, 1).uniform()
        oscillation = detect(record)
        by_samples = quantify(record, oscillation, config=QuantificationConfig(unseen=0.0))
        assert least <= quantify(record, oscillation).S / by_samples.S <= most
