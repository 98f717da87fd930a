"""The loop's forward path, OP to PV, with whatever physics it was given: one free run, never fed with PV."""

from app.engine.mismatch.block import STAGES, Context, Part
from app.engine.mismatch.experiment import Experiment
from app.engine.mismatch.plant import Plant, run_process
from app.engine.recording import FloatArray


def simulate(record: Experiment, plant: Plant, parts: tuple[Part, ...] = ()) -> FloatArray:
    """PV (N,) as deviation from the record's mean, in its unit, simulated from OP and measured signals alone."""
    if record.finer is not None:
        return simulate(record.finer.record, plant, parts)[record.finer.taken]
    return walk(record, plant, parts, None, before=False)


def signal_before(record: Experiment, plant: Plant, parts: tuple[Part, ...], stop: Part) -> FloatArray:
    """The signal (N,) that reaches the part `stop`."""
    return walk(record, plant, parts, stop, before=True)


def signal_after(record: Experiment, plant: Plant, parts: tuple[Part, ...], stop: Part) -> FloatArray:
    """The signal (N,) that leaves the stage of the part `stop`."""
    return walk(record, plant, parts, stop, before=False)


def walk(record: Experiment, plant: Plant, parts: tuple[Part, ...], stop: Part | None, *, before: bool) -> FloatArray:
    context = Context(record, plant)
    altered = Context(record, altered_plant(context, parts))
    signal = record.op_deviation
    for stage in STAGES:
        here = [part for part in parts if part.block.stage == stage]
        ends_here = stop is not None and any(part is stop for part in here)
        if stage == "process" and not (before and ends_here):
            signal = through_process(signal, here, altered.plant, context)
        for part in here:
            if before and part is stop:
                return signal
            if part.block.apply is not None:
                signal = part.block.apply(signal, part.values, altered if stage == "load" else context)
        if ends_here:
            return signal
    return signal


def altered_plant(context: Context, parts: tuple[Part, ...]) -> Plant:
    """The plant with what the parts of the process change of it."""
    plant = context.plant
    for part in parts:
        if part.block.alter is not None:
            plant = part.block.alter(plant, part.values, context)
    return plant


def through_process(signal: FloatArray, parts: list[Part], plant: Plant, context: Context) -> FloatArray:
    for part in parts:
        if part.block.replaces is not None:
            return part.block.replaces(signal, plant, part.values, context) + context.record.rest
    return run_process(signal, plant, context.record.sampling_interval_s) + context.record.rest
