"""What makes explanations quick changes none of their numbers, and is compiled before the first of them."""

import sys
from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest
from scipy.linalg import expm

from app.engine.mismatch import compile_kernels
from app.engine.mismatch.compete import competition
from app.engine.mismatch.fit import closed_loop, fitting
from app.engine.mismatch.fit import noise as noise_module
from app.engine.mismatch.fit.fitting import fit_linear, polish, quiet_noise
from app.engine.mismatch.fit.noise import NoiseModel, coloured, fit_noise, scaled_innovations, whiten
from app.engine.mismatch.fit.scan import Start, task_with
from app.engine.mismatch.fit.task import Given, start_at
from app.engine.mismatch.loop import plant as plant_module
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.chain import ForwardPath, simulate
from app.engine.mismatch.loop.experiment import Experiment, experiment
from app.engine.mismatch.loop.plant import Plant, delay, lag, run_process
from app.engine.mismatch.physics import (
    corners,
    friction,
    library,
    moments,
    oscillation,
    two_tanks,
    valve_slew_limit,
)
from app.engine.mismatch.physics.corners import rounded
from app.engine.quantification import quantify

quantification = sys.modules[quantify.__module__]  # which its package hides behind the function of the same name
TS = 2.0
PLANT = Plant(1.2, 30.0, 7.0, b=0.3, x0=-0.5, tau2=9.0)


def record() -> Experiment:
    rng = np.random.default_rng(5)
    op = 40.0 + np.repeat(rng.uniform(-8.0, 8.0, 20), 20)
    moves = run_process(op - np.mean(op), PLANT, TS) + np.cumsum(rng.normal(0.0, 0.05, 400))
    return experiment(TS, op, 60.0 + moves + rng.normal(0.0, 0.1, 400), measured=(("AUX", rng.normal(size=400)),))


def usable(n: int) -> np.ndarray:
    known = np.ones(n, dtype=np.bool_)
    known[:3] = known[50:52] = known[100:130] = False
    return known


def test_signals_kept_of_recent_simulations_change_none_whatever_moves():
    given = record()
    context = Context(given, PLANT)
    others = (PLANT, PLANT.changed(K=1.5), PLANT.changed(theta=9.0, x0=0.1), PLANT)
    first = library(given)[0]
    known = Part(first, first.starts(context, given.pv_deviation)[3])
    for block in library(given):
        if block.suits is not None and not block.suits(context):
            continue
        starts = block.starts(context, given.pv_deviation)
        path = ForwardPath(given, (known.block, block), PLANT)
        for values in (starts[0], starts[-1], starts[0] * 1.01):
            for plant in others:
                parts = (known, Part(block, values))
                kept = path.run(plant.row(), [part.values for part in parts])
                assert np.array_equal(kept, simulate(given, plant, parts)), block.name
            rows = np.array([plant.row() for plant in others])
            each = path.run_each(rows, [part.values for part in parts])
            assert np.array_equal(each, [simulate(given, plant, parts) for plant in others]), block.name


def test_scaled_innovations_are_the_whitened_residual_less_a_row():
    rng = np.random.default_rng(1)
    pv, simulated, less = rng.normal(size=300), rng.normal(size=(2, 300)), rng.normal(size=310)
    noise, rows = NoiseModel((0.95, 0.3), (0.4, 0.1), 1.7), np.zeros((2, 310))
    scaled_innovations(pv, simulated, usable(300), noise, less, rows)
    expected = [whiten(pv - one, usable(300), noise)[3:] / 1.7 - less[:297] for one in simulated]
    np.testing.assert_allclose(rows[:, :297], expected, rtol=1e-12)
    assert not rows[:, 297:].any()


def test_whitening_takes_what_is_not_known_for_predicted_and_begins_anew_after_a_gap():
    rng = np.random.default_rng(2)
    r, known = rng.normal(size=200), usable(200)
    (p1, p2), (z1, z2) = (0.9, 0.2), (0.5, -0.1)
    filled, e, hidden = r.copy(), np.zeros(200), 0
    for t in range(200):
        past = [filled[t - k] if t >= k else 0.0 for k in (1, 2)]
        news = [e[t - k] if t >= k else 0.0 for k in (1, 2)]
        if known[t] and hidden >= 4:
            past[0] = filled[t - 1] = r[t]
        predicted = (p1 + p2) * past[0] - p1 * p2 * past[1] - (z1 + z2) * news[0] + z1 * z2 * news[1]
        filled[t] = r[t] if known[t] else predicted
        e[t] = 0.0 if not known[t] or hidden >= 4 else r[t] - predicted
        hidden = 0 if known[t] else hidden + 1
    np.testing.assert_allclose(whiten(r, known, NoiseModel((p1, p2), (z1, z2))), e, atol=1e-12)


def test_noise_is_fitted_where_its_innovations_are_least():
    rng = np.random.default_rng(3)
    e, r = rng.normal(0.0, 0.3, 6000), np.zeros(6000)
    for t in range(1, 6000):
        r[t] = 0.92 * r[t - 1] + e[t] - 0.4 * e[t - 1]
    known = np.ones(6000, dtype=np.bool_)
    known[3000:3020] = False
    found = fit_noise(r, known)
    assert found.deviation == pytest.approx(0.3, rel=0.02)
    assert max(found.poles) == pytest.approx(0.92, abs=0.03)


@pytest.mark.parametrize("late", [0.0, 0.5, 3.0, 7.3, 39.5, 40.0, 55.0])
def test_a_delay_interpolates_and_holds_the_first_value_before(late: float):
    v = np.random.default_rng(4).normal(size=40)
    expected = np.interp(np.arange(40) - late, np.arange(40), v)
    np.testing.assert_allclose(delay(v, late * TS, TS), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("tau", "tau2"),
    [(30.0, 8.0), (0.2, 8.0), (8.0, 0.2), (8.0, 8.0), (8.0, 8.0 + 1e-7), (8.0, 2e-3), (2e-3, 8.0), (0.02, 5e-5)],
)
def test_two_lags_are_exact_whichever_is_the_shorter(tau: float, tau2: float) -> None:
    """A signal held over each sample: between two samples the state follows the matrix exponential."""
    given, K, b = record().op_deviation, 1.3, 0.2
    move = expm(TS * np.array([[-1.0 / tau, 0.0, 1.0 / tau], [1.0 / tau2, -1.0 / tau2, 0.0], [0.0, 0.0, 0.0]]))
    state, expected = np.zeros(2), np.zeros(len(given))
    for t in range(1, len(given)):
        state = move[:2, :2] @ state + move[:2, 2] * (K * given[t - 1] + b)
        expected[t] = state[1]
    np.testing.assert_allclose(run_process(given, Plant(K, tau, 0.0, b=b, tau2=tau2), TS), expected, atol=1e-9)


def base() -> fitting.Fit:
    return fit_linear(record(), Given(PLANT.changed(b=0.0, x0=0.0), second_order=True))


def test_a_pattern_search_asks_nothing_twice(monkeypatch):
    found = base()
    block = next(block for block in library(found.record) if block.name == "valve.stiction/he")
    task = task_with(found, block)
    asked: list[bytes] = []
    whole = fitting.residual_rows

    def counted(task, x, noise):
        asked.append(x.tobytes())
        return whole(task, x, noise)

    noise = quiet_noise(found.record, found.given)
    start = block.starts(Context(found.record, found.plant), found.residual)[20]
    x = start_at(task, found.plant, start)
    for _ in range(8):
        x = polish(task, x, noise)
    monkeypatch.setattr(fitting, "residual_rows", counted)
    assert np.array_equal(polish(task, x, noise), x)
    assert len(asked) == len(set(asked))


def test_starts_at_one_place_are_descended_from_once(monkeypatch):
    found = base()
    block = next(block for block in library(found.record) if block.name == "valve.deadband")
    first, second = block.starts(Context(found.record, found.plant), found.residual)[[10, 20]]
    places: list[bytes] = []
    whole = competition.descended

    def counted(task, x, steps):
        places.append(x.tobytes())
        return whole(task, x, steps)

    monkeypatch.setattr(competition, "descended", counted)
    scanned = competition.Scanned(block, (Start(first, 2.0), Start(second, 1.0), Start(first, 1.0)), 2.0, 1.0)
    begun = competition.begin(scanned, found)
    assert len(places) == len(set(places)) == 2
    assert len(begun) == 3


@pytest.mark.parametrize("rate", [5.0, -5.0, float("nan")])
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_process_that_runs_away_gains_nothing_and_is_no_fault(rate: float):
    def runs_away(signal, plant, values, context):
        with np.errstate(over="ignore"):
            return np.sign(rate) * np.exp(np.abs(rate) * np.arange(len(signal)))

    found = base()
    known = next(block for block in library(found.record) if block.name == "process.resonance")
    block = replace(known, replaces=runs_away, suits=None)
    scanned = competition.survey(found, (block,))[0]
    assert max(scanned.gain, scanned.quiet_gain) <= 0.0
    fits = competition.begin(scanned, found)
    assert len(fits) == len(scanned.starts) == 4
    assert all(fit.likelihood < found.likelihood for fit in fits)


@pytest.mark.parametrize("sizes", [(0.7, -0.3), (0.7, -0.3, 0.2, 0.1, -0.4, 0.5)])
def test_a_wave_is_the_sum_of_its_odd_harmonics_within_its_time(sizes: tuple[float, ...]):
    given = record()
    values = np.array([100.0, 700.0, 37.0, *sizes])
    phase = 2.0 * np.pi * given.time_s / 37.0
    pairs = zip(sizes[::2], sizes[1::2], strict=True)
    waves = [a * np.sin(k * phase) + b * np.cos(k * phase) for k, (a, b) in zip((1, 3, 5), pairs, strict=False)]
    inside = (given.time_s >= 100.0) & (given.time_s < 700.0)
    expected = given.pv_deviation + np.where(inside, np.sum(waves, axis=0), 0.0)
    np.testing.assert_allclose(
        oscillation.wave(given.pv_deviation, values, Context(given, PLANT)), expected, atol=1e-10
    )


def test_a_rounded_limit_is_straight_far_from_its_corner_and_logistic_at_it():
    signal = np.linspace(-3.0, 3.0, 601)
    for width, sign in ((0.02, 1.0), (0.5, -1.0)):
        under = sign * (0.4 - signal) / width
        expected = 0.4 - sign * width * np.logaddexp(0.0, under)
        np.testing.assert_allclose(rounded(signal, 0.4, width, sign), expected, atol=1e-14)


def test_the_plant_answers_a_step_as_its_equation_does() -> None:
    v = np.ones(200)
    v[0] = 0.0
    y = run_process(v, Plant(K=2.0, tau=20.0, theta=4.0), 1.0)
    t = np.arange(200)
    expected = np.where(t >= 5, 2.0 * (1.0 - np.exp(-(t - 5.0) / 20.0)), 0.0)
    assert y == pytest.approx(expected, abs=1e-9)


def test_noise_is_coloured_as_it_was_whitened() -> None:
    model = NoiseModel((0.93, 0.4), (0.3, 0.0))
    e = np.random.default_rng(0).normal(size=500)
    assert whiten(coloured(e, model), np.ones(500, dtype=bool), model) == pytest.approx(e)


KERNELS = (
    (plant_module, "_process"),
    (plant_module, "_processes"),
    (friction, "_place"),
    (friction, "_speed"),
    (friction, "_sprung"),
    (valve_slew_limit, "_limited"),
    (two_tanks, "_tanks"),
    (noise_module, "_whiten"),
    (noise_module, "_minimise"),
    (noise_module, "_colour"),
    (closed_loop, "_follow"),
    (noise_module, "_scaled_innovations"),
    (moments, "_ramp"),
    (oscillation, "_add_harmonics"),
    (corners, "_rounded"),
    (quantification, "residuals"),
)


def test_every_kernel_of_a_comparison_runs_once_when_a_worker_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is left out is compiled within the first explanation that needs it, a minute late."""
    ran = set()

    def noting(module: ModuleType, name: str) -> Callable:
        kernel = getattr(module, name)

        def noted(*given: object) -> object:
            ran.add((module, name))
            return kernel(*given)

        return noted

    for module, name in KERNELS:
        monkeypatch.setattr(module, name, noting(module, name))
    compile_kernels()
    assert ran == set(KERNELS)


def test_a_lag_is_exact_for_a_signal_that_is_straight_between_its_samples():
    times, tau = TS * np.arange(60), 7.0
    behind = times - tau * (1.0 - np.exp(-times / tau))
    np.testing.assert_allclose(lag(times, tau, TS), behind, rtol=1e-12)
