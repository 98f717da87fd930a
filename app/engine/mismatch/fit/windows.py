"""Masks as windows: from a start up to, not at, an end, in seconds from the start of the record."""

from dataclasses import dataclass

import numpy as np

from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.chain import signal_after, signal_before
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.recording import BoolArray


@dataclass(frozen=True)
class Window:
    """A stretch of the record, s from its start, up to, not at, its end: that of the last sample's interval."""

    start_s: float
    end_s: float


def windows_of(mask: BoolArray, sampling_interval_s: float, least: int = 2, first_s: float = 0.0) -> tuple[Window, ...]:
    """The stretches of at least `least` samples where the mask (N,) is True; first_s: its first sample, s from the
    start of the recording, before which none begins.
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return tuple(
        Window(max(first_s + float(a * sampling_interval_s), 0.0), first_s + float(b * sampling_interval_s))
        for a, b in pairs
        if b - a >= least
    )


def windows_along(record: Experiment, mask: BoolArray) -> tuple[Window, ...]:
    """The stretches of a record (N,) where the mask (N,) is True."""
    return windows_of(mask, record.sampling_interval_s, first_s=record.first_s)


def whole(record: Experiment) -> tuple[Window, ...]:
    return (Window(max(record.first_s, 0.0), record.first_s + record.duration_s),)


def active_mask(fit: Fit, part: Part) -> BoolArray:
    """Where a part of a fit acts, (N,): judged by the signal that reaches it, for a part of the process by the one
    it makes.
    """
    if part.block.active is None:
        return np.ones(fit.record.samples, dtype=np.bool_)
    of_process = part.block.stage == "process"
    signal = (signal_after if of_process else signal_before)(fit.record, fit.plant, fit.parts, part)
    return part.block.active(signal, part.values, Context(fit.record, fit.plant))
