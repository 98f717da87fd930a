"""Linear surrogates, and whether a record looks stickier than they do."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from app.engine.features import Features, at_rest, extract, observe_parts
from app.engine.fitness import assess
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import UniformRecord
from app.engine.signals.surrogates import kept_step, linear_surrogates
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop
from app.engine.verdict import look_alikes as comparing
from app.engine.verdict.look_alikes import LookAlikes, look_alikes
from app.engine.verdict.shape_model import fitted_model
from app.engine.verdict.weighing import weigh

MODEL = fitted_model()


def record_of(
    S: float, seed: int = 1, load_sd: float = 0.0, sp: tuple[tuple[float, float], ...] = (), seconds: float = 1000.0
) -> UniformRecord:
    """A flow whose valve sticks by S, or does not while its load wanders. sp: steps of its set point."""
    spec = LoopSpec(
        plant=first_order(1.0, 3.0, 1.0), controller=Pid(0.3, 6.0), noise=Signal(noise_sd=0.03),
        valve=TwoParameterValve(S, S), upset=Signal(value=3.0, noise_sd=load_sd, noise_tau_s=50.0),
        settle_s=300.0, sp=Signal(steps=sp),
    )  # fmt: skip
    return assess(simulate_loop(spec, seconds, 1.0, seed=seed).recording("flow")).audited


def compared(record: UniformRecord, oscillation: Oscillation | None = None) -> LookAlikes:
    oscillation = oscillation or detect(record)
    return look_alikes(record, oscillation, weigh(record, oscillation).log_odds_by_shapes, MODEL)


@pytest.mark.parametrize("n", [400, 401])
def test_a_surrogate_has_the_spectra_of_its_signals_and_what_goes_together_in_them(n):
    rng = np.random.default_rng(3)
    pv = np.cumsum(rng.normal(size=n))
    op = np.sign(np.sin(0.1 * np.arange(n))) + 0.3 * pv
    surrogates = linear_surrogates(pv, op)
    for made_pv, made_op in (next(surrogates), next(surrogates)):
        assert (made_pv.shape, made_op.shape) == ((n,), (n,))
        assert not np.allclose(made_pv, pv, atol=0.1)
        flat = [
            np.fft.rfft(x - np.linspace(y[0], y[-1], n)) for x, y in ((made_pv, pv), (made_op, op), (pv, pv), (op, op))
        ]
        np.testing.assert_allclose(np.abs(flat[0]), np.abs(flat[2]), atol=1e-8)
        np.testing.assert_allclose(np.abs(flat[1]), np.abs(flat[3]), atol=1e-8)
        np.testing.assert_allclose(flat[0] * flat[1].conj(), flat[2] * flat[3].conj(), atol=1e-6)


def test_a_line_keeps_step_in_every_surrogate_and_noise_does_not():
    n = 1200
    line, noise = 3.0 * np.sin(2.0 * np.pi * 30 * np.arange(n) / n), np.random.default_rng(1).normal(size=n)
    drift = np.linspace(0.0, 50.0, n) ** 2
    for x, least, most in ((line, 0.99, 1.0001), (line + noise + drift, 0.5, 1.0), (noise, 0.0, 0.4), (0 * line, 0, 0)):
        others = (1e4 - 7.0 * next(linear_surrogates(x, x, seed))[0] for seed in range(2))
        kept = [float(kept_step(one, [413], 80.0, 10.0)[0]) for one in (x, *others)]
        assert least <= min(kept) <= max(kept) <= most
        assert max(kept) == pytest.approx(min(kept), abs=0.02)


def test_surrogates_of_a_seed_are_the_same_and_of_another_others():
    x = np.random.default_rng(1).normal(size=(2, 100))
    np.testing.assert_array_equal(next(linear_surrogates(*x)), next(linear_surrogates(*x)))
    assert not np.allclose(next(linear_surrogates(*x)), next(linear_surrogates(*x, seed=1)))


def test_a_sticky_valve_looks_stickier_than_a_linear_loop_and_that_is_soon_seen():
    found = compared(record_of(2.0))
    assert found.shown
    assert found.surrogates < 19


def test_linear_loops_look_stickier_than_themselves_as_seldom_as_is_said():
    wandering = record_of(0.0, load_sd=0.3)
    oscillation = detect(wandering)
    drawn = linear_surrogates(wandering.pv, wandering.op, seed=11)
    linear = [replace(wandering, pv=pv, op=op) for (pv, op), _ in zip(drawn, range(60), strict=False)]
    shown = [compared(record, oscillation).shown for record in linear]
    # Two of a hundred by its level: five of sixty would come in one of 150 tries.
    assert sum(shown) <= 4


def drawn_from(record: UniformRecord, count: int, oscillation: Oscillation) -> list[Features]:
    surrogates = linear_surrogates(record.pv, record.op, seed=5)
    return [
        extract(replace(record, pv=pv, op=op), oscillation)
        for (pv, op), _ in zip(surrogates, range(count), strict=False)
    ]


@pytest.mark.parametrize(("windows", "counts"), [(1, [5, 10, 19]), (2, [4, 7, 13]), (3, [3, 5, 11])])
def test_the_more_windows_tell_independently_the_fewer_surrogates_are_needed(windows, counts):
    drawn = [features_of(np.zeros((windows, 2)), np.full(windows, 1.0 / windows))]
    assert [comparing._needed(whole, clear, drawn) for whole, clear, _ in comparing._STAGES] == counts
    overlapping = [replace(drawn[0], overlap=True)]
    assert [comparing._needed(whole, clear, overlapping) for whole, clear, _ in comparing._STAGES] == [5, 10, 19]


@pytest.mark.parametrize(("windows", "count"), [(2, 6), (3, 3), (3, 7), (6, 7)])
def test_of_every_two_windows_each_surrogate_meets_each_of_the_others_once(windows, count):
    weights = np.full(windows, 1.0 / windows)
    # Window w of surrogate k says count^w k: their mean tells which of them went into it.
    drawn = [features_of(float(count) ** np.arange(windows)[:, None] * k, weights) for k in range(count)]
    mixed = np.rint(windows * comparing._recombined(drawn)[:, 0]).astype(int)
    of = np.array([[value // count**w % count for w in range(windows)] for value in mixed])
    assert of.shape == (count**2, windows)
    for one, other in combinations(range(windows), 2):
        assert len(set(zip(of[:, one], of[:, other], strict=True))) == count**2


def test_windows_that_share_samples_or_differ_in_number_or_weight_are_not_recombined():
    one, two = features_of(np.zeros((1, 2)), np.ones(1)), features_of(np.ones((2, 2)), np.full(2, 0.5))
    # Three windows of the whole and one of the rest of its set point, and the other way round.
    three_and_one = np.array([1.0, 1.0, 1.0, 3.0]) / 6.0
    other = [features_of(np.eye(4), three_and_one), features_of(np.eye(4), three_and_one[::-1])]
    for drawn in ([two, one], [replace(two, overlap=True)] * 2, [two, replace(two, overlap=True)], other):
        assert comparing._recombined(drawn).tolist() == [features.values.tolist() for features in drawn]


def features_of(table: np.ndarray, weights: np.ndarray) -> Features:
    return Features(weights @ table, table, weights, False, ())


def test_windows_of_different_surrogates_scatter_as_those_of_one_do():
    record = record_of(2.0, seconds=5000.0)
    drawn = drawn_from(record, 60, detect(record))
    assert len(drawn[0].weights) == 3
    assert not drawn[0].overlap
    whole = MODEL.log_odds(np.array([features.values for features in drawn]))
    mixed = MODEL.log_odds(comparing._recombined(drawn[:59]))
    assert np.mean(mixed) == pytest.approx(np.mean(whole), abs=0.25 * np.std(whole))
    # Of 60 draws a standard deviation is known to 9 %.
    assert np.std(mixed) == pytest.approx(np.std(whole), rel=0.25)


def linear_record(cycles: float, seed: int) -> UniformRecord:
    """What a load of so many cycles makes of a linear loop: every harmonic at a phase of its own."""
    n, rng = 2400, np.random.default_rng(seed)
    phase = 2.0 * np.pi * cycles * np.arange(n) / n
    pv = np.sign(np.sin(phase)) * np.sqrt(np.abs(np.sin(phase))) + 0.05 * rng.normal(size=n)
    op = 2.0 / np.pi * np.arcsin(np.sin(phase - 0.5 * np.pi)) + 0.015 * rng.normal(size=n)
    pv, op = next(linear_surrogates(pv, op, 1000 + seed))
    return UniformRecord(1.0, pv, op, None, np.zeros(n, dtype=bool))


@pytest.mark.parametrize(("cycles", "most"), [(50.0, 5), (51.17, 3)])
def test_a_linear_loop_under_a_strictly_periodic_load_is_not_taken_for_more_than_linear(cycles, most):
    records = [linear_record(cycles, seed) for seed in range(40)]
    assert sum(compared(record).shown for record in records) <= most


@pytest.mark.parametrize(("seconds", "windows", "overlap"), [(1000.0, 1, False), (2000.0, 2, True), (3000.0, 2, False)])
def test_windows_share_samples_where_a_record_hardly_holds_two(seconds, windows, overlap):
    record = record_of(2.0, seconds=seconds)
    features = extract(record, detect(record))
    assert (len(features.weights), features.overlap) == (windows, overlap)


def test_unit_offset_and_sign_of_pv_and_op_change_nothing():
    record = record_of(2.0)
    other = replace(record, pv=500.0 - 30.0 * record.pv, op=7.0 + 0.01 * record.op)
    assert compared(other).surrogates == compared(record).surrogates
    assert compared(other).chance == pytest.approx(compared(record).chance, rel=1e-4)


def test_where_the_set_point_steps_its_rest_is_compared_with_surrogates_of_its_rest(monkeypatch):
    record = record_of(1.0, load_sd=0.1, sp=((500.0, 6.0), (650.0, -12.0)))
    oscillation, rest = detect(record), at_rest(record)
    weighed = weigh(record, oscillation)
    assert rest is not None
    compared_with = []

    def spied(parts):
        compared_with.append(parts)
        return observe_parts(parts)

    monkeypatch.setattr(comparing, "observe_parts", spied)
    found = look_alikes(record, oscillation, weighed.log_odds_by_shapes, MODEL)
    assert found.shown
    assert found.surrogates == len(compared_with)
    for parts in compared_with:
        assert [part.record.samples for part in parts] == [record.samples, rest.samples]
        assert parts[0].oscillation == oscillation
        for part, of in zip(parts, (record, rest), strict=True):
            line = np.linspace(of.pv[0], of.pv[-1], of.samples)
            power = [np.abs(np.fft.rfft(x - line)) for x in (part.record.pv, of.pv)]
            np.testing.assert_allclose(*power, atol=1e-8)
            assert not np.allclose(part.record.pv, of.pv, atol=0.1)


def test_of_what_never_varies_nothing_is_shown():
    record = replace(record_of(2.0), pv=np.full(1000, 3.0)[: record_of(2.0).samples])
    assert look_alikes(record, detect(record_of(2.0)), 1.0, MODEL) == LookAlikes(1.0, 0)
