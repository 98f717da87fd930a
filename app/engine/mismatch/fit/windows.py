"""Masks as windows: from a start up to, not at, an end, in seconds from the start of the record."""

from dataclasses import dataclass

import numpy as np

from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.chain import signal_after, signal_before
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.recording import BoolArray
from app.engine.signals.runs import runs_of


@dataclass(frozen=True)
class Window:
    """A stretch of the record, s from its start, up to, not at, its end: that of the last sample's interval."""

    start_s: float
    end_s: float


def _cut_to(record: Experiment, start_s: float, end_s: float) -> Window:
    """What of a stretch (s from the start of the recording) lies within that: where PV is held, it may have been taken
    before the first sample, and be held beyond the last.
    """
    return Window(max(start_s, 0.0), min(end_s, record.end_s))


def windows_along(record: Experiment, mask: BoolArray, least: int = 2) -> tuple[Window, ...]:
    """The stretches of a record (N,), of at least `least` samples, where the mask (N,) is True."""
    first_s, ts = record.first_s, record.sampling_interval_s
    return tuple(
        _cut_to(record, first_s + float(a * ts), first_s + float(b * ts))
        for a, b in zip(*runs_of(mask), strict=True)
        if b - a >= least
    )


def whole(record: Experiment) -> tuple[Window, ...]:
    return (_cut_to(record, record.first_s, record.first_s + record.duration_s),)


def active_mask(fit: Fit, part: Part) -> BoolArray:
    """Where a part of a fit acts, (N,): judged by the signal that reaches it, for a part of the process by the one
    it makes.
    """
    if part.block.active is None:
        return np.ones(fit.record.samples, dtype=np.bool_)
    of_process = part.block.stage == "process"
    signal = (signal_after if of_process else signal_before)(fit.record, fit.plant, fit.parts, part)
    return part.block.active(signal, part.values, Context(fit.record, fit.plant))
