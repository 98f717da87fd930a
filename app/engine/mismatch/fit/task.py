"""What is fitted: the numbers of a linear plant and of the blocks beside it, with what is known of them beforehand."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.engine.mismatch.loop.block import Block, Context, Parameter, Part
from app.engine.mismatch.loop.chain import ForwardPath
from app.engine.mismatch.loop.experiment import FIRST_SAMPLES, Experiment
from app.engine.mismatch.loop.plant import NUMBERS, Plant
from app.engine.recording import BoolArray, FloatArray

GIVEN_DEVIATION = 0.05
OWN_DEVIATION = 1.0
_FREED_DEVIATION = 0.4
START_DEVIATION, _SPEED_DEVIATION = 0.05, 0.3  # of PV's span
_BEFORE_SHARE = 0.25  # of OP's span: how far OP usually moves within a dead time


@dataclass(frozen=True)
class Given:
    """The linear model to start from, and how far to trust it.

    plant: gain, time constants, dead time. deviation: relative standard deviation of its time constants, and, where
    `late_deviation` is None, of its dead time; where `gain_deviation` is None, of its gain.
    second_order, integrating: its structure, which the refit keeps. behind_stem: our own, found behind a stem.
    further: how many lags of an autoregression the noise beside it has beyond its poles and zeros.
    """

    plant: Plant
    deviation: float = GIVEN_DEVIATION
    second_order: bool = False
    integrating: bool = False
    behind_stem: bool = False
    late_deviation: float | None = None
    gain_deviation: float | None = None
    further: int = 0

    @property
    def own(self) -> bool:
        """Whether no simulation was given, and it is our own guess from the same record."""
        return self.deviation >= OWN_DEVIATION


@dataclass(frozen=True)
class Free:
    """One free number of a fit: x = (log) value / scale, normal prior (centre, deviation) and bounds, all of x."""

    name: str
    scale: float
    centre: float
    deviation: float
    low: float
    high: float
    log: bool = False
    step: float = 1e-3
    linear: bool = False
    smooth: bool = False

    def value(self, x: float) -> float:
        return float(self.scale * (np.exp(x) if self.log else x))

    def coordinate(self, value: float) -> float:
        return float(np.log(max(value, 1e-300) / self.scale) if self.log else value / self.scale)


def _linear_free(record: Experiment, given: Given, gain_deviation: float) -> tuple[Free, ...]:
    """The free numbers of the linear plant, with what is known of them from the given simulation."""
    g, ts, span = given.plant, record.sampling_interval_s, record.pv_span
    wide = max(5.0 * given.deviation, 0.3)
    gain_trusted = given.deviation if given.gain_deviation is None else given.gain_deviation
    free = [Free("K", g.K, 1.0, max(gain_trusted, gain_deviation), 0.05, 20.0)]
    if not given.integrating:
        free.append(Free("tau", g.tau, 0.0, given.deviation, -wide, wide, log=True))
    for name, lag in (("tau2", g.tau2), ("tau3", g.tau3)):
        if lag > 0.0:
            free.append(Free(name, lag, 0.0, given.deviation, -wide, wide, log=True))
    if g.damping > 0.0:
        free.append(Free("damping", g.damping, 0.0, given.deviation, -wide, wide, log=True))
    trusted = given.deviation if given.late_deviation is None else given.late_deviation
    late = np.hypot(trusted * g.theta, 0.15 * ts) / ts
    free.append(Free("theta", ts, g.theta / ts, late, 0.0, max(3.0 * g.theta / ts, 3.0 + g.theta / ts), step=0.05))
    drift = max(abs(g.K) * record.op_span, 1e-300) if given.integrating else span
    free.append(Free("b", drift, 0.0, 10.0, -50.0, 50.0))
    first = record.pv_first / span
    free.append(Free("x0", span, first, start_deviation(record, g), first - 2.0, first + 2.0))
    if g.damping > 0.0:
        free.append(Free("speed0", span, 0.0, _SPEED_DEVIATION, -3.0, 3.0))
    return tuple(free)


def start_deviation(record: Experiment, plant: Plant) -> float:
    """How far the mean of the first samples may be from where PV started (share of the span): by their noise at least,
    judged by the differences of PV, and by what OP did before the record and is still on its way to PV.
    """
    noise = float(np.std(np.diff(record.pv))) / np.sqrt(2.0 * FIRST_SAMPLES)
    late = plant.theta + plant.tau2
    answered = 1.0 - np.exp(-late / plant.tau) if plant.leak > 0.0 else late
    coming = _BEFORE_SHARE * abs(plant.K) * record.op_span * answered
    return max(START_DEVIATION, float(np.hypot(noise, coming)) / record.pv_span)


def _part_free(parameter: Parameter, rough: bool) -> Free:
    """The free number of a block's parameter, with its prior within its bounds."""
    smooth, known = parameter.step is not None, parameter.deviation
    step = parameter.step if parameter.step is not None else 0.02 if rough else 2e-3
    if parameter.log:
        low, high = np.log(parameter.low / parameter.scale), np.log(parameter.high / parameter.scale)
        return Free(parameter.name, parameter.scale, 0.0, known, float(low), float(high), True, step, smooth=smooth)
    low, high = parameter.low / parameter.scale, parameter.high / parameter.scale
    centre = 1.0 if np.isfinite(known) else 0.0
    return Free(parameter.name, parameter.scale, centre, known, low, high, False, step, parameter.linear, smooth)


@dataclass(frozen=True, eq=False)
class Task:
    """A simulation to fit: which numbers are free and what they mean."""

    record: Experiment
    given: Given
    blocks: tuple[Block, ...]
    free: tuple[Free, ...]
    counts: tuple[int, ...]
    centre: FloatArray
    certainty: FloatArray
    low: FloatArray
    high: FloatArray
    scale: FloatArray
    log: BoolArray

    def plant_at(self, x: FloatArray) -> Plant:
        return self.plant_of(self.values_at(x))

    def parts_at(self, x: FloatArray) -> tuple[Part, ...]:
        return self.parts_of(self.values_at(x))

    def simulated(self, x: FloatArray) -> FloatArray:
        """PV (N,) at coordinates x (P,)."""
        values = self.values_at(x)
        return self.path.run(self.row_of(values), self.of_blocks(values))

    def simulated_each(self, points: FloatArray, alike: int) -> FloatArray:
        """PV (L, N) at coordinates (L, P), the first of which, so many, have the numbers of the blocks in common."""
        values, simulated = [self.values_at(x) for x in points], np.empty((len(points), self.record.samples))
        if alike:
            rows = np.array([self.row_of(there) for there in values[:alike]])
            simulated[:alike] = self.path.run_each(rows, self.of_blocks(values[0]))
        for k in range(alike, len(points)):
            simulated[k] = self.path.run(self.row_of(values[k]), self.of_blocks(values[k]))
        return simulated

    def values_at(self, x: FloatArray) -> FloatArray:
        """The free numbers (P,) in their units at coordinates x."""
        values = x.copy()
        values[self.log_at] = np.exp(x[self.log_at])
        values *= self.scale
        return values

    def row_of(self, values: FloatArray) -> FloatArray:
        """The plant of values (P,) as the kernel reads it (15,)."""
        row = self.given_row.copy()
        row[self.linear_at] = values[: self.linear_count]
        return row

    def of_blocks(self, values: FloatArray) -> list[FloatArray]:
        return [values[place] for place in self.places]

    def plant_of(self, values: FloatArray) -> Plant:
        linear = values[: self.linear_count].tolist()
        return self.given.plant.changed(**dict(zip(self.linear_names, linear, strict=True)))

    def parts_of(self, values: FloatArray) -> tuple[Part, ...]:
        return tuple([Part(block, own) for block, own in zip(self.blocks, self.of_blocks(values), strict=True)])

    @cached_property
    def path(self) -> ForwardPath:
        return ForwardPath(self.record, self.blocks, self.given.plant)

    @cached_property
    def given_row(self) -> FloatArray:
        return self.given.plant.row()

    @cached_property
    def linear_at(self) -> NDArray[np.int64]:
        """Where the free numbers of the plant stand in its row."""
        return np.array([NUMBERS.index(name) for name in self.linear_names])

    @cached_property
    def step(self) -> FloatArray:
        """(P,) over what a slope is taken in each coordinate."""
        return np.array([f.step for f in self.free])

    @cached_property
    def log_at(self) -> NDArray[np.int64]:
        """Which of the free numbers are fitted as logarithms."""
        return np.flatnonzero(self.log)

    @cached_property
    def places(self) -> tuple[slice, ...]:
        """Where the values of each block stand among the free numbers."""
        ends = (self.linear_count + np.cumsum(self.counts)).tolist()
        return tuple(slice(end - count, end) for end, count in zip(ends, self.counts, strict=True))

    @cached_property
    def linear_count(self) -> int:
        return len(self.free) - sum(self.counts)

    @cached_property
    def linear_names(self) -> tuple[str, ...]:
        return tuple(f.name for f in self.free[: self.linear_count])


def make_task(record: Experiment, given: Given, blocks: tuple[Block, ...]) -> Task:
    """The task of fitting the given linear model together with `blocks`."""
    loose = _FREED_DEVIATION if any(block.frees_gain for block in blocks) else 0.0
    free = list(_linear_free(record, given, loose))
    context = Context(record, given.plant)
    counts = []
    for k, block in enumerate(blocks):
        offered = [_part_free(parameter, block.rough) for parameter in block.parameters(context)]
        free += [replace(f, name=f"{k}.{f.name}") for f in offered]
        counts.append(len(offered))
    return Task(
        record,
        given,
        blocks,
        tuple(free),
        tuple(counts),
        centre=np.array([f.centre for f in free]),
        certainty=np.array([1.0 / f.deviation for f in free]),
        low=np.array([f.low for f in free]),
        high=np.array([f.high for f in free]),
        scale=np.array([f.scale for f in free]),
        log=np.array([f.log for f in free]),
    )


def start_at(task: Task, plant: Plant, values: FloatArray) -> FloatArray:
    """Coordinates of a linear plant and the blocks' values in a row."""
    linear = [f.coordinate(getattr(plant, f.name)) for f in task.free if "." not in f.name]
    rest = [f.coordinate(v) for f, v in zip(task.free[len(linear) :], values, strict=True)]
    return clipped(task, np.array(linear + rest))


def clipped(task: Task, x: FloatArray) -> FloatArray:
    return np.minimum(np.maximum(x, task.low), task.high)
