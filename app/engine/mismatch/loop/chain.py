"""The loop's forward path, OP to PV, with whatever physics it was given: one free run, never fed with PV."""

from collections.abc import Callable
from functools import partial

import numpy as np

from app.engine.mismatch.loop.block import STAGES, Context, Part, Stage
from app.engine.mismatch.loop.experiment import LARGEST, Experiment
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.recording import FloatArray

BEFORE: tuple[Stage, ...] = ("valve", "input")
PROCESS: tuple[Stage, ...] = ("load", "process")
BEHIND: tuple[Stage, ...] = ("output", "sensor")
MOST_RECENT = 8


class Recent:
    """The signals of the latest simulations of one task, by the numbers that made them: a search moves few numbers at
    a time, and what does not depend on those stays as it was.
    """

    def __init__(self) -> None:
        self.known: dict[bytes, FloatArray] = {}

    def signal(self, numbers: bytes, make: Callable[[], FloatArray]) -> FloatArray:
        """The signal (N,) that these numbers make; made where it is not known, in place of the one longest unused."""
        found = self.known.pop(numbers, None)
        if found is None:
            found = make()
            if len(self.known) == MOST_RECENT:
                del self.known[next(iter(self.known))]
        self.known[numbers] = found
        return found


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
    signal, numbers, context = record.op_deviation, b"", Context(record, plant)
    for part in (part for stage in BEFORE for part in parts if part.block.stage == stage):
        numbers += part.values.tobytes()
        signal = recent.signal(numbers, partial(through_parts, signal, [part], context))
    for part in (part for part in parts if part.block.stage in PROCESS):
        numbers += part.values.tobytes()
    make = partial(through, record, plant, parts, signal, PROCESS)
    signal = recent.signal(numbers + plant.row().tobytes(), make)
    if all(part.block.stage not in BEHIND for part in parts):
        return signal
    return through(record, plant, parts, signal, BEHIND)


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
            signal = through_process(signal, here, altered.plant, context)
        if here:
            signal = through_parts(signal, here, altered if stage == "load" else context)
    return signal


def through_parts(signal: FloatArray, here: list[Part], context: Context) -> FloatArray:
    for part in here:
        if part.block.apply is not None:
            signal = part.block.apply(signal, part.values, context)
    return signal


def altered_plant(context: Context, parts: tuple[Part, ...]) -> Plant:
    """The plant with what the parts of the process change of it."""
    plant = context.plant
    for part in parts:
        if part.block.alter is not None:
            plant = part.block.alter(plant, part.values, context)
    return plant


def through_process(signal: FloatArray, parts: list[Part], plant: Plant, context: Context) -> FloatArray:
    """What the process makes of a signal (N,); one that runs away is cut to what can be squared."""
    replacing = next((part for part in parts if part.block.replaces is not None), None)
    if replacing is None or replacing.block.replaces is None:
        pv = run_process(signal, plant, context.record.sampling_interval_s)
    else:
        pv = replacing.block.replaces(signal, plant, replacing.values, context)
    if not np.max(np.abs(pv)) < LARGEST:
        pv = np.nan_to_num(np.clip(pv, -LARGEST, LARGEST), nan=LARGEST)
    return pv + context.record.rest
