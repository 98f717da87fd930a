"""Records longer than names compete on: averages where they say the same, and never of a loop whose OP follows PV."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, LinearSimulation, explain, locate
from app.engine.mismatch.compare.comparison import MOST_SAMPLES, record_of, shortened
from app.engine.mismatch.compare.thinning import factor_for, held_means, refined
from app.engine.mismatch.compete.competition import Contender
from app.engine.mismatch.compete.naming import Believed
from app.engine.mismatch.compete.selection import Selection
from app.engine.mismatch.fit.fitting import fit_linear
from app.engine.mismatch.fit.task import OWN_DEVIATION, Given
from app.engine.mismatch.loop.block import Part
from app.engine.mismatch.loop.experiment import experiment
from app.engine.mismatch.loop.law import fed_back
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics import library
from app.engine.recording import FloatArray

TAU, GAIN, INTEGRAL = 10.0, 2.0, 10.0


def loop(
    samples: int,
    moving: bool = False,
    late: int = 0,
    seed: int = 0,
    bent: float = 0.0,
    filtered: float = 0.0,
    shaken: float = 0.0,
) -> Comparison:
    """A PI loop shaken by its load and by noise, at 1 s, and the right simulation of it. bent: of the gain with OP.
    filtered: the share of its filtered PV that the controller keeps with each sample. shaken: OP's own noise.
    """
    rng, stay = np.random.default_rng(seed), np.exp(-1.0 / TAU)
    noise, shocks = 0.3 * rng.standard_normal(samples), 0.3 * rng.standard_normal(samples)
    sp = np.where(moving & (np.arange(samples) // 400 % 2 == 1), 5.0, 0.0)
    op, pv = np.zeros(samples), np.zeros(samples)
    own = shaken * rng.standard_normal(samples)
    state = load = integral = seen = 0.0
    for t in range(samples):
        pv[t] = state + noise[t]
        seen = filtered * seen + (1.0 - filtered) * pv[t]
        error = sp[t] - seen
        integral += GAIN * error / INTEGRAL
        op[t] = GAIN * error + integral + own[t]
        u = op[t - late] if t >= late else 0.0
        load = 0.9 * load + shocks[t]
        state = stay * state + (1.0 - stay) * (u + bent * u * abs(u) + load)
    simulation = LinearSimulation(1.0, (TAU,), float(late))
    return Comparison("loop", 1.0, 50.0 + op, 50.0 + pv, 50.0 + sp, simulation=simulation)


def experiment_of(samples: int, added: FloatArray | float = 0.0) -> Comparison:
    """An experiment: OP in steps that follow nothing, PV behind a lag of 60 s at 1 s."""
    rng = np.random.default_rng(5)
    u = np.repeat(rng.uniform(-5.0, 5.0, samples // 100 + 1), 100)[:samples]
    u -= np.mean(u)
    pv = 50.0 + run_process(u, Plant(1.0, 60.0, 0.0), 1.0) + 0.3 * rng.standard_normal(samples) + added
    return Comparison("experiment", 1.0, 40.0 + u, pv, simulation=LinearSimulation(1.0, (60.0,)))


@pytest.mark.parametrize(("moving", "late", "samples"), [(False, 0, 4800), (True, 0, 4100), (False, 1, 4800)])
def test_a_clean_loop_of_many_samples_is_cleared(moving: bool, late: int, samples: int) -> None:
    said = explain(loop(samples, moving, late))
    assert said.verdict == "consistent", [effect.code for effect in said.effects]
    assert not [reason for reason in said.evidence if reason.code == "parameters_off"]


@pytest.mark.parametrize(("samples", "filtered", "shaken"), [(2400, 0.7, 0.0), (4800, 0.0, 0.6)])
def test_a_clean_loop_is_cleared_whatever_its_controller_does(samples: int, filtered: float, shaken: float) -> None:
    """OP carries the noise of PV though no PID law of PV explains it."""
    comparison = loop(samples, moving=True, filtered=filtered, shaken=shaken)
    record = record_of(comparison)
    assert not record.op_follows_pv
    assert record.fed_back
    said = explain(comparison)
    assert said.verdict == "consistent", [effect.code for effect in said.effects]


@pytest.mark.parametrize("late", [0.0, 5.0])
@pytest.mark.parametrize("tau", [0.01, 3.0, 60.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_experiment_is_taken_for_a_loop(tau: float, late: float, sign: float) -> None:
    """Nor where the process answers within a sample, as in averages; nor what holds no noise, or does not move."""
    rng = np.random.default_rng(6)
    for u in (rng.standard_normal(6000), np.cumsum(rng.standard_normal(6000))):
        pv = run_process(u, Plant(sign, tau, late), 1.0)
        noisy = pv + 0.1 * np.std(pv) * rng.standard_normal(6000)
        assert not experiment(1.0, u, noisy).fed_back
        assert not experiment(3.0, held_means(u, 3), held_means(noisy, 3)).fed_back
    wave = np.sin(np.arange(6000) / 40.0)
    assert not fed_back(None, run_process(wave, Plant(sign, tau, late), 1.0), wave, np.ones(6000, dtype=np.bool_))
    assert not fed_back(None, pv, np.full(6000, 50.0), np.ones(6000, dtype=np.bool_))


def test_a_bent_gain_is_named_in_a_loop_of_many_samples() -> None:
    said = explain(loop(4800, moving=True, bent=0.05))
    assert "process.nonlinear_gain" in (said.effects[0].code, *said.effects[0].alternatives)


def test_a_first_look_at_a_clean_loop_of_many_samples_finds_nothing() -> None:
    assert locate(loop(4100, moving=True)).block is None


def test_no_averages_are_taken_beside_a_simulation_where_op_follows_pv() -> None:
    samples = MOST_SAMPLES + 1000
    closed, free = loop(samples, moving=True), experiment_of(samples)
    begun, averaged = shortened(closed), shortened(free)
    assert np.array_equal(begun.pv, closed.pv[:MOST_SAMPLES])
    assert begun.sampling_interval_s == closed.sampling_interval_s
    assert [note.code for note in begun.notes] == ["part_explained"]
    assert averaged.sampling_interval_s == 2.0 * free.sampling_interval_s
    assert not averaged.notes
    slow = Given(Plant(1.0, 60.0, 0.0))
    assert factor_for(fit_linear(record_of(closed.part(slice(0, 9000))), slow, 1)) == 1
    assert factor_for(fit_linear(record_of(free.part(slice(0, 9000))), slow, 1)) == 3
    own = replace(slow, deviation=OWN_DEVIATION)
    assert factor_for(fit_linear(record_of(closed.part(slice(0, 9000))), own, 1)) == 3
    assert shortened(replace(closed, simulation=None)).sampling_interval_s == 2.0


@pytest.mark.parametrize("by_trace", [False, True])
def test_of_a_long_loop_the_part_is_explained_in_which_something_happens(by_trace: bool) -> None:
    """An effect that begins after the first samples that can be fitted is in no part that ends before it."""
    samples, at = MOST_SAMPLES + 12_000, MOST_SAMPLES + 4000
    closed = loop(samples, moving=True)
    if by_trace:
        trace = 50.0 + run_process(closed.op - 50.0, Plant(1.0, TAU, 0.0), 1.0)
        closed = replace(closed, simulation=None, trace=trace)
    late = replace(closed, pv=closed.pv + 6.0 * (np.arange(samples) >= at))
    part = shortened(late)
    begin = samples - MOST_SAMPLES
    assert np.array_equal(part.pv, late.pv[begin:])
    assert np.array_equal(part.op, late.op[begin:])
    (note,) = part.notes
    assert f"those from {begin} to {samples - 1} s" in note.text
    assert np.array_equal(shortened(closed).pv, closed.pv[:MOST_SAMPLES])


def test_what_averages_suggest_of_our_own_loop_goes_with_a_reason(competing_on: Callable[[int], None]) -> None:
    """OP's means hold the controller's answers; what they are taken for does not pay among the samples themselves."""
    competing_on(1000)
    said = explain(replace(loop(1100, moving=True, seed=1), simulation=None))
    assert said.verdict == "consistent"
    assert "whole_disagrees" in [reason.code for reason in said.evidence]


def test_a_name_that_pays_stands_though_it_moves_the_error_of_a_long_record_little() -> None:
    at = np.arange(9000)
    said = explain(experiment_of(9000, 0.36 * ((at >= 3000) & (at < 3060))))
    assert said.effects
    assert "sensor.step" in (said.effects[0].code, *said.effects[0].alternatives)
    assert said.effects[0].windows[0].start_s == pytest.approx(3000.0, abs=10.0)


def test_a_name_that_the_whole_record_does_not_bear_goes_with_a_reason() -> None:
    record = record_of(experiment_of(1200))
    base = fit_linear(record, Given(Plant(1.0, 60.0, 0.0)))
    block = next(block for block in library(record) if block.name == "sensor.step")
    fitted = replace(base, likelihood=base.likelihood + 20.0, parts=(Part(block, np.array([600.0, 0.0])),))
    effect = Believed(block.code, (), 20.0, 20.0, Contender(fitted, base))
    found = refined(base, Selection(fitted, (effect,), ()))
    assert not found.selection.effects
    assert [reason.code for reason in found.lost] == ["whole_disagrees"]
    assert found.lost[0].text.startswith("sensor.step would explain the shortened record")
