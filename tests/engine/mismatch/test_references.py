"""What a model refers to beside its numbers (a duration, where signals stood, whether OP follows PV) goes with it to
another record: a stretch, a second recording, a model simulated again.
"""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch import Comparison, LinearSimulation, explain, simulate_again
from app.engine.mismatch.fit.closed_loop import first_stretch
from app.engine.mismatch.fit.fitting import Fit, finish, fit, fit_linear
from app.engine.mismatch.fit.noise import NoiseModel
from app.engine.mismatch.fit.task import Given, make_task, start_at
from app.engine.mismatch.judge.validation import lasting, validate
from app.engine.mismatch.location import quick_location
from app.engine.mismatch.loop.block import Block, Context, Part
from app.engine.mismatch.loop.chain import simulate
from app.engine.mismatch.loop.experiment import Experiment, alike, experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.mismatch.physics import named
from app.engine.mismatch.physics.gain_drift import as_it_ended
from app.engine.mismatch.physics.terms import made_of
from app.engine.mismatch.report import export
from app.engine.recording import FloatArray
from app.errors import DataError
from app.services.explaining.line import model_from_line, model_line
from tests.engine.open_loop import moves

LONG, TS = 9000, 1.0
LAG, LEVEL = Plant(1.0, 40.0, 3.0), Plant(0.02, 1.0, 3.0, leak=0.0)


def driven(plant: Plant, samples: int = LONG, seed: int = 0) -> Experiment:
    u = moves(samples, 60, seed=seed)
    return experiment(TS, 40.0 + u, 50.0 + run_process(u, plant, TS))


def fitted(record: Experiment, plant: Plant, block: Block, values: FloatArray) -> Fit:
    """A fit that has these values, whatever the record says."""
    given = Given(plant, integrating=plant.leak == 0.0)
    task = make_task(record, given, (block,))
    return finish(task, start_at(task, plant, values), NoiseModel())


def of_name(record: Experiment, name: str) -> Block:
    return named(record, (name,))[name]


GROWING = (
    (LEVEL, "disturbance.step", (1000.0, 4.0)),
    (LEVEL, "disturbance.ramp", (1000.0, 3000.0, 4.0)),
    (LAG, "process.gain_drift", (500.0, 1.0)),
    (LAG, "process.gain_drift/whole", (500.0, 0.5, 4.0)),
    (LAG, "process.dead_time/grows", (80.0,)),
    (LAG, "unnamed/terms:op_times_time+pv_times_time_lagged", (0.7, 0.3)),
)


@pytest.mark.parametrize(("plant", "name", "values"), GROWING)
def test_effects_are_as_large_on_the_beginning_of_their_record(
    plant: Plant, name: str, values: tuple[float, ...]
) -> None:
    record = driven(plant)
    whole = fitted(record, plant, of_name(record, name), np.array(values))
    part = first_stretch(whole)
    again = simulate(part.record, part.plant, part.parts)
    assert np.std(again - simulate(part.record, part.plant)) > 0.01
    assert again == pytest.approx(whole.simulated[: part.record.samples], abs=1e-9)
    assert part.record.samples < record.samples


@pytest.mark.parametrize(("plant", "name", "values"), GROWING)
def test_a_model_means_the_same_along_an_op_of_another_length(
    plant: Plant, name: str, values: tuple[float, ...]
) -> None:
    record = driven(plant)
    whole = fitted(record, plant, of_name(record, name), np.array(values))
    model = model_from_line(model_line(export(whole, ())))
    again = simulate_again(model, record.op[:4000]) - record.pv_mid
    assert again == pytest.approx(whole.simulated[:4000], abs=1e-9)


@pytest.mark.parametrize(("plant", "values"), [(LAG, (4.0,)), (LEVEL, (4.0, -0.02))])
def test_a_vessel_that_overflows_simulates_the_same_again(plant: Plant, values: tuple[float, ...]) -> None:
    """Beside an integrator its limit comes with the balance."""
    record = driven(plant, 1200)
    whole = fitted(record, plant, of_name(record, "process.overflow/high"), np.array(values))
    model = model_from_line(model_line(export(whole, ())))
    assert np.max(whole.simulated) <= 4.0
    assert simulate_again(model, record.op) - record.pv_mid == pytest.approx(whole.simulated, abs=1e-9)
    lacking = replace(model, parts=(replace(model.parts[0], values=()),))
    with pytest.raises(DataError, match="overflow/high needs finite values of limit"):
        simulate_again(lacking, record.op)


@pytest.mark.parametrize("exponent", [0.0, -0.5])
def test_a_power_that_no_level_falls_by_is_refused(exponent: float) -> None:
    """As a part of a model has it, and as its plant: an exponent of 0 divided by itself."""
    record = driven(LAG, 300)
    weir = of_name(record, "process.outflow_law/weir")
    model = model_from_line(model_line(export(fitted(record, LAG, weir, np.array([20.0, 1.5])), ())))
    of_part = replace(model, parts=(replace(model.parts[0], values=(20.0, exponent)),))
    with pytest.raises(DataError, match="outflow_law/weir needs head, exponent above 0"):
        simulate_again(of_part, record.op)
    of_plant = replace(model, plant=(*model.plant, ("head", 20.0), ("exponent", exponent)), parts=())
    with pytest.raises(DataError, match="exponent must be more than 0"):
        simulate_again(of_plant, record.op)


def test_terms_of_moments_of_one_record_are_left_out_of_another() -> None:
    names = ("op_2", "op_times_time", "pv_3", "pv_times_time_lasting")
    kept = lasting((Part(made_of(names), np.array([1.0, 2.0, 3.0, 4.0])),))
    assert [part.block.form for part in kept] == ["terms:op_2+pv_3"]
    assert kept[0].values.tolist() == [1.0, 3.0]
    assert lasting((Part(made_of(names[1:2]), np.array([2.0])),)) == ()
    timeless = Part(made_of(names[:1]), np.array([1.0]))
    assert lasting((timeless,)) == (timeless,)


SET_IN = (
    ("valve.stiction/sets_in", (3.0, 0.5, 700.0), "valve.stiction/he", [3.0, 0.5, 0.0]),
    ("valve.stiction/choudhury_sets_in", (3.0, 0.5, 700.0), "valve.stiction/choudhury", [3.0, 0.5, 0.0]),
    ("valve.deadband/grows", (3.0, 0.2, 0.4), "valve.deadband", [3.0, 0.0]),
    ("process.dead_time/sets_in", (700.0, 12.0), "process.dead_time", [12.0]),
    ("process.dead_time/grows", (12.0,), "process.dead_time", [12.0]),
)


@pytest.mark.parametrize(("name", "values", "since", "known"), SET_IN)
def test_what_set_in_is_there_all_along_in_another_record(
    name: str, values: tuple[float, ...], since: str, known: list[float]
) -> None:
    record = driven(LAG, 1200)
    (part,) = lasting((Part(of_name(record, name), np.array(values)),))
    assert part.block.name == since
    assert part.values.tolist() == known
    assert len(known) == len(part.block.parameters(Context(record, LAG)))


DRIFTED = (
    ("process.gain_drift", (300.0, 0.6)),
    ("process.gain_drift/step", (300.0, 0.6)),
    ("process.gain_drift/held", (300.0, 900.0, 0.6)),
    ("process.gain_drift/whole", (300.0, 0.6, 4.0)),
    ("process.gain_drift/whole-step", (300.0, 0.6, 4.0)),
)


@pytest.mark.parametrize(("name", "values"), DRIFTED)
def test_a_gain_that_drifted_is_as_it_ended_in_another_record(name: str, values: tuple[float, ...]) -> None:
    """The drift went on to the end of the first record, and the second one follows it."""
    whole = driven(LAG, 2400)
    block, drifted = of_name(whole, name), np.array(values)
    simulated = fitted(replace(whole, reference_s=1200.0 * TS), LAG, block, drifted).simulated
    pv = whole.pv_mid + simulated + 0.01 * np.random.default_rng(0).standard_normal(2400)
    first, second = (experiment(TS, whole.op[part], pv[part]) for part in (slice(1200), slice(1200, None)))
    task = make_task(first, Given(LAG), (block,))
    final = fit(task, start_at(task, LAG, drifted))
    told = validate(fit_linear(first, Given(LAG)), final, (), second, None)
    assert told.explained.rmse < 0.1 * told.refitted.rmse


def test_a_gain_that_came_and_went_is_as_it_was() -> None:
    record = driven(LAG, 1200)
    passing = Part(of_name(record, "process.gain_drift/passing"), np.array([300.0, 700.0, 0.6]))
    assert lasting((as_it_ended(passing, Context(record, LAG)),)) == ()


@pytest.mark.parametrize("follows", [False, True])
def test_an_unnamed_model_simulates_the_same_again(follows: bool) -> None:
    """Its terms answer OP at once in an experiment, and a sample later where a controller set OP from PV."""
    record = replace(driven(replace(LAG, theta=0.0), 1200), feedback=follows)
    block = of_name(record, "unnamed/dynamic")
    whole = fitted(record, replace(LAG, theta=0.0), block, np.array([3.0, -2.0, 1.0, 0.5]))
    model = model_from_line(model_line(export(whole, ())))
    assert model.op_follows_pv is follows
    assert simulate_again(model, record.op) - record.pv_mid == pytest.approx(whole.simulated, abs=1e-9)
    assert record.with_op(record.op + 1.0).fed_back is follows
    assert alike(record, driven(LAG, 600, 3)).fed_back is follows


def test_a_model_without_these_is_taken_for_one_of_the_record_at_hand() -> None:
    record = driven(LAG, 1200)
    line = model_line(export(fitted(record, LAG, of_name(record, "process.gain_drift"), np.array([100.0, 1.0])), ()))
    short = model_from_line({k: line[k] for k in line if k not in ("duration_s", "measured_mids", "op_follows_pv")})
    assert simulate_again(short, record.op) == pytest.approx(simulate_again(model_from_line(line), record.op))


def with_cause(level: float, seed: int, still: bool = False) -> Comparison:
    """PV answers OP and a load, which stands at a level and moves about it or not at all."""
    rng = np.random.default_rng(seed)
    u, load = moves(1200, 60, seed=seed), np.full(1200, level)
    load += 0.0 if still else np.repeat(rng.uniform(-4.0, 4.0, 40), 30)
    pv = 50.0 + run_process(u + 0.5 * (load - 50.0), LAG.changed(theta=0.0), TS) + 0.05 * rng.standard_normal(1200)
    return Comparison(
        "loop", TS, 40.0 + u, pv, measured=(("LOAD", load),), simulation=LinearSimulation(1.0, (40.0,), 0.0)
    )


@pytest.mark.parametrize("still", [False, True])
def test_a_cause_that_stands_elsewhere_moves_pv_in_a_second_recording(still: bool) -> None:
    first, second = with_cause(50.0, 1), with_cause(60.0, 2, still)
    said = explain(first, second)
    assert [effect.code for effect in said.effects] == ["disturbance.coupling"]
    assert said.validation is not None
    assert said.validation.refitted.rmse > 3.0
    assert said.validation.explained.rmse < 0.3
    again = simulate_again(said.model, second.op, second.measured)
    assert np.sqrt(np.mean((again - second.pv)[200:] ** 2)) < 0.3


def test_a_first_look_shows_where_a_limit_of_pv_acts() -> None:
    """Not where OP would be beyond that limit."""
    rng, u = np.random.default_rng(4), moves(1980, 60, seed=4)
    true = run_process(u, Plant(0.4, 60.0, 10.0), TS)
    limit = float(np.quantile(true, 0.68))
    pv = 50.0 + np.minimum(true, limit) + 0.02 * rng.standard_normal(1980)
    record = experiment(TS, 40.0 + u, pv)
    base = fit_linear(record, Given(Plant(0.4, 60.0, 10.0)))
    found = quick_location(base, (of_name(record, "sensor.saturation/high"),))
    inside = np.zeros(1980, dtype=np.bool_)
    for window in found.windows:
        inside[round(window.start_s / TS) : round(window.end_s / TS)] = True
    acts = true > limit
    assert found.block == "sensor"
    assert np.sum(inside & acts) > 0.85 * np.sum(inside | acts)
