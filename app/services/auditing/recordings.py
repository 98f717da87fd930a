"""Stored samples as the engine takes them."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from app.engine.recording import Recording
from app.ingest import LoopSamples, realigned, second_zero_ns, to_recording
from app.storage.loops import LoopRow
from app.storage.samples import Samples

_NAMES = {"pv": "PV", "op": "OP", "sp": "SP", "automatic": "MODE"}


def recording_of(loop: LoopRow, samples: Samples) -> Recording:
    """The engine's record of stored samples: the same that a file with these samples gives, with the loop's spans."""
    recording = to_recording(_stretch(samples, loop.tag), loop.tag)
    return replace(recording, pv_range=loop.pv_range, op_range=loop.op_range, integrating=loop.integrating)


def _stretch(samples: Samples, loop: str) -> LoopSamples:
    """PV and OP that came in files of their own are brought to the same times, as those of one file are."""
    signals = samples.signals
    own: dict[str, Any] = {name: signals.get(name) for name in ("pv", "op", "sp", "automatic")}
    others: Mapping[str, np.ndarray] = {name.removeprefix("tag:"): signals[name] for name in signals if name not in own}
    stretch = LoopSamples(loop, samples.time_ns, **own, others=MappingProxyType(others))
    if samples.apart is None or not np.any(samples.apart):
        return stretch
    sampled = {_NAMES.get(name, name.removeprefix("tag:")): rows for name, rows in samples.sampled.items()}
    return realigned(stretch, samples.apart, sampled)


def origin_ns(samples: Samples) -> int:
    """The instant of a recording's second 0."""
    stretch = _stretch(samples, "")
    return second_zero_ns(stretch.time_ns, stretch.pv, stretch.op)
