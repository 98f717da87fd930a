"""The loop's forward path, OP to PV, with whatever physics it was given: one free run, never fed with PV."""

from collections.abc import Sequence

import numpy as np

from app.engine.mismatch.loop.block import STAGES, Block, Context, Part, Stage
from app.engine.mismatch.loop.experiment import LARGEST, Experiment
from app.engine.mismatch.loop.plant import Plant, plant_of, run_rows, with_rest
from app.engine.recording import FloatArray

_BEFORE: tuple[Stage, ...] = ("valve", "input")
BEHIND: tuple[Stage, ...] = ("output", "sensor")
_MOST_RECENT = 8


class ForwardPath:
    """The way from OP to PV through given blocks, to be simulated again and again: a search moves few numbers at a
    time, and what does not depend on those stays as it was in one of the latest simulations.

    record: from which everything is simulated. blocks: in the order in which their values are given. plant: for blocks
    before the process, which depend on their values alone.
    """

    def __init__(self, record: Experiment, blocks: Sequence[Block], plant: Plant) -> None:
        self.record = record.as_sampled
        self.context = Context(self.record, plant)
        self.taken = None if record.finer is None else record.finer.taken
        self.blocks = tuple(blocks)
        self.before, self.load, self.process, self.behind = (
            tuple(k for stage in stages for k, block in enumerate(blocks) if block.stage == stage)
            for stages in (_BEFORE, ("load",), ("process",), BEHIND)
        )
        self.inside = (*self.load, *self.process)
        self.recent: dict[bytes, FloatArray] = {}

    def run(self, row: FloatArray, values: Sequence[FloatArray]) -> FloatArray:
        """PV (N,) as `simulate` has it, of a plant as the kernel reads it (15,) and the values of each block."""
        signal, numbers = self.into_process(values)
        for k in self.inside:
            numbers += values[k].tobytes()
        numbers += row.tobytes()
        pv = self.latest(numbers)
        if pv is None:
            pv = self.keep(numbers, self.out_of_process(signal, row, values))
        pv = self.as_shown(pv, row, values)
        return pv if self.taken is None else pv[self.taken]

    def run_each(self, rows: FloatArray, values: Sequence[FloatArray]) -> FloatArray:
        """PV (L, N) of each of some plants (L, 15) behind and before the same values of each block."""
        if self.inside:
            return np.stack([self.run(row, values) for row in rows])
        signal, _ = self.into_process(values)
        pv = run_rows(signal, rows, self.record.sampling_interval_s, self.record.rest, LARGEST)
        if self.behind:
            pv = np.stack([self.as_shown(one, row, values) for one, row in zip(pv, rows, strict=True)])
        return pv if self.taken is None else pv[:, self.taken]

    def into_process(self, values: Sequence[FloatArray]) -> tuple[FloatArray, bytes]:
        """The signal (N,) that reaches load and process, and the numbers that made it."""
        signal, numbers = self.record.op_deviation, b""
        for k in self.before:
            numbers += values[k].tobytes()
            known = self.latest(numbers)
            if known is None:
                known = self.keep(numbers, _passed(self.blocks[k], signal, values[k], self.context))
            signal = known
        return signal, numbers

    def out_of_process(self, signal: FloatArray, row: FloatArray, values: Sequence[FloatArray]) -> FloatArray:
        """What load and process make of a signal (N,)."""
        record = self.record
        if not self.inside:
            return run_rows(signal, row[None, :], record.sampling_interval_s, record.rest, LARGEST)[0]
        context = Context(record, plant_of(row))
        process = [Part(self.blocks[k], values[k]) for k in self.process]
        altered = Context(record, altered_plant(context, process)) if process else context
        for k in self.load:
            signal = _passed(self.blocks[k], signal, values[k], altered)
        return _through_parts(_through_process(signal, process, altered.plant, context), process, context)

    def as_shown(self, pv: FloatArray, row: FloatArray, values: Sequence[FloatArray]) -> FloatArray:
        """What the blocks behind the process make of its PV (N,)."""
        if self.behind:
            context = Context(self.record, plant_of(row))
            for k in self.behind:
                pv = _passed(self.blocks[k], pv, values[k], context)
        return pv

    def latest(self, numbers: bytes) -> FloatArray | None:
        """The signal that these numbers made in one of the latest simulations, from now on the one latest used."""
        found = self.recent.pop(numbers, None)
        if found is not None:
            self.recent[numbers] = found
        return found

    def keep(self, numbers: bytes, signal: FloatArray) -> FloatArray:
        """The signal, kept in place of the one longest unused."""
        if len(self.recent) == _MOST_RECENT:
            del self.recent[next(iter(self.recent))]
        self.recent[numbers] = signal
        return signal


def simulate(record: Experiment, plant: Plant, parts: tuple[Part, ...] = ()) -> FloatArray:
    """PV (N,) as deviation from the record's mean, in its unit, simulated from OP and measured signals alone."""
    if record.finer is not None:
        return simulate(record.finer.record, plant, parts)[record.finer.taken]
    return _through(record, plant, parts, record.op_deviation, STAGES)


def signal_before(record: Experiment, plant: Plant, parts: tuple[Part, ...], stop: Part) -> FloatArray:
    """The signal (N,) that reaches the part `stop`."""
    stage, context = stop.block.stage, Context(record, plant)
    signal = _through(record, plant, parts, record.op_deviation, STAGES[: STAGES.index(stage)])
    here = [part for part in parts if part.block.stage == stage]
    altered = Context(record, altered_plant(context, parts))
    return _through_parts(signal, here[: here.index(stop)], altered if stage == "load" else context)


def signal_after(record: Experiment, plant: Plant, parts: tuple[Part, ...], stop: Part) -> FloatArray:
    """The signal (N,) that leaves the stage of the part `stop`."""
    return _through(record, plant, parts, record.op_deviation, STAGES[: STAGES.index(stop.block.stage) + 1])


def _through(
    record: Experiment, plant: Plant, parts: tuple[Part, ...], signal: FloatArray, stages: tuple[Stage, ...]
) -> FloatArray:
    """What some stages make of a signal (N,); before the process it depends on the parts' values alone."""
    context = Context(record, plant)
    altered = Context(record, altered_plant(context, parts))
    for stage in stages:
        here = [part for part in parts if part.block.stage == stage]
        if stage == "process":
            signal = _through_process(signal, here, altered.plant, context)
        if here:
            signal = _through_parts(signal, here, altered if stage == "load" else context)
    return signal


def _through_parts(signal: FloatArray, here: Sequence[Part], context: Context) -> FloatArray:
    for part in here:
        signal = _passed(part.block, signal, part.values, context)
    return signal


def _passed(block: Block, signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return signal if block.apply is None else block.apply(signal, values, context)


def altered_plant(context: Context, parts: Sequence[Part]) -> Plant:
    """The plant with what the parts of the process change of it."""
    plant = context.plant
    for part in parts:
        if part.block.alter is not None:
            plant = part.block.alter(plant, part.values, context)
    return plant


def passes_sums(context: Context, parts: Sequence[Part], stage: Stage) -> bool:
    """Whether what comes behind a stage answers a sum of signals with the sum of its answers."""
    behind = [part.block for part in parts if STAGES.index(part.block.stage) > STAGES.index(stage)]
    if not all(block.affine or (block.apply is None and block.replaces is None) for block in behind):
        return False
    return stage in BEHIND or altered_plant(context, parts).linear


def _through_process(signal: FloatArray, parts: Sequence[Part], plant: Plant, context: Context) -> FloatArray:
    """What the process makes of a signal (N,); one that runs away is cut to what can be squared."""
    record = context.record
    for part in parts:
        if part.block.replaces is not None:
            pv = part.block.replaces(signal, plant, part.values, context)
            return with_rest(pv, record.rest, LARGEST)
    return run_rows(signal, plant.row()[None, :], record.sampling_interval_s, record.rest, LARGEST)[0]
