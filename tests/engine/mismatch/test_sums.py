"""Points of a scan that are sums of what fewer blocks do: a pulse is a jump less a later one."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.mismatch.fit.fitting import Fit, finish, fit_linear, quiet_noise
from app.engine.mismatch.fit.scan import Start, ground, scan, sums_of, task_with
from app.engine.mismatch.fit.task import Given, start_at
from app.engine.mismatch.loop.block import Block, Context, Part
from app.engine.mismatch.loop.chain import passes_sums, simulate
from app.engine.mismatch.loop.experiment import Experiment, experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.mismatch.physics import library
from app.engine.recording import FloatArray

N, TS = 700, 2.0
LAG, LEVEL = Plant(K=1.4, tau=30.0, theta=7.0, tau2=8.0), Plant(K=0.02, tau=1.0, theta=7.0, leak=0.0)


def recorded(plant: Plant, parts: tuple[Part, ...] = ()) -> Experiment:
    """A record of a load that steps, with white noise on PV, and a signal beside it."""
    rng = np.random.default_rng(3)
    op = 40.0 + np.repeat(rng.uniform(-6.0, 6.0, N // 50), 50)
    pv = 50.0 + simulate(experiment(TS, op, op), plant, parts) + np.where(np.arange(N) > 400, 1.0, 0.0)
    beside = (("feed", np.cumsum(rng.normal(size=N))),)
    return experiment(TS, op, pv + 0.1 * rng.normal(size=N), measured=beside)


def beside(plant: Plant, name: str | None, values: list[float]) -> Fit:
    """The linear refit of a record, and the block of this name beside it where one is named."""
    record = recorded(plant)
    found = fit_linear(record, Given(plant))
    if name is None:
        return found
    task = task_with(found, named(record, name))
    return finish(task, start_at(task, found.plant, np.array(values)), found.noise)


def named(record: Experiment, name: str) -> Block:
    return next(block for block in library(record) if block.name == name)


SUMS = [block.name for block in library(recorded(LAG)) if block.sum_of is not None]
AFFINE = [block.name for block in library(recorded(LAG)) if block.affine]
# Of those that act on a signal; terms without a name are looked for when all has been scanned.
BENT = [
    block.name
    for block in library(recorded(LAG))
    if block.apply is not None and not block.affine and block.code != "unnamed"
]
BEHIND: dict[str | None, list[float]] = {
    None: [],
    "disturbance.step": [800.0, 0.5],
    "process.dead_time": [4.0],
    "process.gain_drift": [100.0, 0.4],
}


def test_there_are_such() -> None:
    assert len(SUMS) == 10
    assert set(SUMS) - set(AFFINE) == {"valve.saturation/both"}


@pytest.mark.parametrize("plant", [LAG, LEVEL], ids=["lag", "level"])
@pytest.mark.parametrize("behind", BEHIND, ids=str)
def test_a_scan_of_sums_finds_what_one_of_each_point_does(plant: Plant, behind: str | None) -> None:
    found = beside(plant, behind, BEHIND[behind])
    grounds = ground(found, found.noise), ground(found, quiet_noise(found.record, found.given))
    for name in SUMS:
        block = named(found.record, name)
        assert sums_of(block, found, grids(block, found)) is not None
        fixed = [not p.linear for p in block.parameters(Context(found.record, found.plant))]
        for quick, plain in zip(scan(block, grounds), scan(replace(block, sum_of=None), grounds), strict=True):
            there = {start.values[fixed].tobytes(): start for start in plain}
            assert len(there) == len(quick) == len(plain)
            for start in quick:
                alike(start, there[start.values[fixed].tobytes()])


def alike(quick: Start, plain: Start) -> None:
    assert quick.gain == pytest.approx(plain.gain, rel=1e-6, abs=1e-6)
    assert quick.values == pytest.approx(plain.values, rel=1e-4, abs=1e-4)


def grids(block: Block, found: Fit) -> list[FloatArray]:
    return [block.starts(Context(found.record, found.plant), found.residual)]


@pytest.mark.parametrize(
    ("name", "values"), [("sensor.saturation/high", [2.0]), ("process.overflow/high", [2.0])], ids=["sensor", "vessel"]
)
def test_what_is_not_in_proportion_behind_them_passes_none(name: str, values: list[float]) -> None:
    found = beside(LAG, name, values)
    load, valve = (named(found.record, asked) for asked in ("disturbance.step/pulse", "valve.saturation/both"))
    assert sums_of(load, found, grids(load, found)) is None
    assert sums_of(valve, found, grids(valve, found)) is None


def test_from_sizes_that_are_there_already_each_point_is_simulated() -> None:
    found = beside(LAG, None, [])
    load = named(found.record, "disturbance.step/pulse")
    points = grids(load, found)[0] + np.array([0.0, 0.0, 0.3])
    assert sums_of(load, found, [points]) is None


def test_a_valve_before_a_load_is_no_hindrance() -> None:
    found = beside(LAG, "valve.saturation/high", [3.0])
    load = named(found.record, "disturbance.step/pulse")
    assert sums_of(load, found, grids(load, found)) is not None
    context = Context(found.record, found.plant)
    assert not passes_sums(context, (Part(named(found.record, "process.nonlinear_gain"), np.array([0.1])),), "valve")


def off_a_sum(name: str) -> float:
    """By how much a block answers a sum with other than the sum of its answers, over its grid."""
    record = recorded(LAG)
    block, context, rng = named(record, name), Context(record, LAG), np.random.default_rng(5)
    assert block.apply is not None
    scales, off = np.array([p.scale if p.linear else 0.0 for p in block.parameters(context)]), 0.0
    for start in block.starts(context, record.pv_deviation)[::20]:
        one, other = 4.0 * rng.normal(size=(2, N))
        answers = [block.apply(signal, start + scales, context) for signal in (one + other, one, other, np.zeros(N))]
        off = max(off, float(np.max(np.abs(answers[0] + answers[3] - answers[1] - answers[2]))))
    return off


@pytest.mark.parametrize("name", AFFINE)
def test_what_is_affine_answers_a_sum_with_the_sum_of_its_answers(name: str) -> None:
    assert off_a_sum(name) < 1e-9


@pytest.mark.parametrize("name", BENT)
def test_what_is_not_affine_does_not(name: str) -> None:
    """Else scans beside it simulate each point for nothing."""
    assert off_a_sum(name) > 1e-9
