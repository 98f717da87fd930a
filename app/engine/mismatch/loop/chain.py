"""The loop's forward path, OP to PV, with whatever physics it was given: one free run, never fed with PV."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from app.engine.mismatch.loop.block import STAGES, Context, Part, Stage
from app.engine.mismatch.loop.experiment import LARGEST, Experiment
from app.engine.mismatch.loop.plant import Plant, run_row, with_rest
from app.engine.recording import FloatArray

BEFORE: tuple[Stage, ...] = ("valve", "input")
BEHIND: tuple[Stage, ...] = ("output", "sensor")
MOST_RECENT = 8


@dataclass(frozen=True)
class Order:
    """Which of some parts (by index) the signal passes before the process, in this order; which act in the load and in
    the process; and whether any acts behind it.
    """

    before: tuple[int, ...]
    load: tuple[int, ...]
    process: tuple[int, ...]
    behind: bool


def order_of(parts: tuple[Part, ...]) -> Order:
    def at(stage: Stage) -> tuple[int, ...]:
        return tuple(k for k, part in enumerate(parts) if part.block.stage == stage)

    before = tuple(k for stage in BEFORE for k in at(stage))
    return Order(before, at("load"), at("process"), any(part.block.stage in BEHIND for part in parts))


class Recent:
    """The signals of the latest simulations of one task, by the numbers that made them: a search moves few numbers at
    a time, and what does not depend on those stays as it was. And the order of its parts, which stays.
    """

    def __init__(self) -> None:
        self.known: dict[bytes, FloatArray] = {}
        self.order: Order | None = None

    def signal(self, numbers: bytes, make: Callable[[], FloatArray]) -> FloatArray:
        """The signal (N,) that these numbers make; made where it is not known, in place of the one longest unused."""
        found = self.known.pop(numbers, None)
        if found is None:
            found = make()
            if len(self.known) == MOST_RECENT:
                del self.known[next(iter(self.known))]
        self.known[numbers] = found
        return found

    def order_of(self, parts: tuple[Part, ...]) -> Order:
        if self.order is None:
            self.order = order_of(parts)
        return self.order


def simulate(
    record: Experiment, plant: Plant, parts: tuple[Part, ...] = (), recent: Recent | None = None
) -> FloatArray:
    """PV (N,) as deviation from the record's mean, in its unit, simulated from OP and measured signals alone.

    recent: of simulations of the same record and blocks.
    """
    if record.finer is not None:
        return simulate(record.finer.record, plant, parts, recent)[record.finer.taken]
    if recent is None:
        return through(record, plant, parts, record.op_deviation, STAGES)
    order = recent.order_of(parts)
    signal, numbers, context = record.op_deviation, b"", Context(record, plant)
    for k in order.before:
        numbers += parts[k].values.tobytes()
        signal = recent.signal(numbers, partial(through_parts, signal, [parts[k]], context))
    load, process = [parts[k] for k in order.load], [parts[k] for k in order.process]
    for part in (*load, *process):
        numbers += part.values.tobytes()
    row = plant.row()
    make = partial(through_load_and_process, signal, load, process, context, row)
    signal = recent.signal(numbers + row.tobytes(), make)
    return through(record, plant, parts, signal, BEHIND) if order.behind else signal


def through_load_and_process(
    signal: FloatArray, load: list[Part], process: list[Part], context: Context, row: FloatArray
) -> FloatArray:
    """What load and process make of a signal (N,). row: the context's plant, as the kernel reads it."""
    plant = altered_plant(context, process) if process else context.plant
    if load:
        signal = through_parts(signal, load, Context(context.record, plant))
    if plant is not context.plant:
        row = plant.row()
    signal = through_process(signal, process, plant, context, row)
    return through_parts(signal, process, context)


def signal_before(record: Experiment, plant: Plant, parts: tuple[Part, ...], stop: Part) -> FloatArray:
    """The signal (N,) that reaches the part `stop`."""
    stage, context = stop.block.stage, Context(record, plant)
    signal = through(record, plant, parts, record.op_deviation, STAGES[: STAGES.index(stage)])
    here = [part for part in parts if part.block.stage == stage]
    altered = Context(record, altered_plant(context, parts))
    return through_parts(signal, here[: here.index(stop)], altered if stage == "load" else context)


def signal_after(record: Experiment, plant: Plant, parts: tuple[Part, ...], stop: Part) -> FloatArray:
    """The signal (N,) that leaves the stage of the part `stop`."""
    return through(record, plant, parts, record.op_deviation, STAGES[: STAGES.index(stop.block.stage) + 1])


def through(
    record: Experiment, plant: Plant, parts: tuple[Part, ...], signal: FloatArray, stages: tuple[Stage, ...]
) -> FloatArray:
    """What some stages make of a signal (N,); before the process it depends on the parts' values alone."""
    context = Context(record, plant)
    altered = Context(record, altered_plant(context, parts))
    for stage in stages:
        here = [part for part in parts if part.block.stage == stage]
        if stage == "process":
            signal = through_process(signal, here, altered.plant, context, altered.plant.row())
        if here:
            signal = through_parts(signal, here, altered if stage == "load" else context)
    return signal


def through_parts(signal: FloatArray, here: Sequence[Part], context: Context) -> FloatArray:
    for part in here:
        if part.block.apply is not None:
            signal = part.block.apply(signal, part.values, context)
    return signal


def altered_plant(context: Context, parts: Sequence[Part]) -> Plant:
    """The plant with what the parts of the process change of it."""
    plant = context.plant
    for part in parts:
        if part.block.alter is not None:
            plant = part.block.alter(plant, part.values, context)
    return plant


def through_process(
    signal: FloatArray, parts: Sequence[Part], plant: Plant, context: Context, row: FloatArray
) -> FloatArray:
    """What the process makes of a signal (N,); one that runs away is cut to what can be squared. row: the plant as the
    kernel reads it.
    """
    record = context.record
    for part in parts:
        if part.block.replaces is not None:
            pv = part.block.replaces(signal, plant, part.values, context)
            return with_rest(pv, record.rest, LARGEST)
    return with_rest(run_row(signal, row, record.sampling_interval_s), record.rest, LARGEST)
