"""The part of a long record that is explained where nobody says which: that on which its audit identifies the loop."""

from dataclasses import replace

import numpy as np

from app.engine.evidence import Reason
from app.engine.judged import identified_part
from app.engine.long_records.stretches import LONG_SAMPLES
from app.engine.mismatch.compare.comparison import Comparison
from app.engine.recording import Recording


def span_to_explain(recording: Recording) -> tuple[float, float] | None:
    """Start and end in seconds from the start of the recording; None where all of it is explained, because it is not
    long or cannot be audited.

    Over days a load wanders, a unit stands still and set points move: a free run through all that says little of the
    limit cycle of minutes that the verdict is about.
    """
    if recording.samples <= LONG_SAMPLES:
        return None
    part = identified_part(recording)
    if part is None:
        return None
    return part.start_s, part.start_s + (part.samples - 1) * part.sampling_interval_s


def narrowed(comparison: Comparison, recording: Recording | None = None) -> Comparison:
    """The part of a comparison that is explained where its audit decides which, with a note; seconds then count from
    its start.

    recording: what it was made of, with all that an audit knows of it; without, as much of it as a comparison holds.
    """
    recording = recording or _recorded(comparison)
    span = span_to_explain(recording)
    if span is None:
        return comparison
    both = np.flatnonzero(np.isfinite(recording.pv) & np.isfinite(recording.op))
    before_s = float(recording.time_s[both[0]] - recording.time_s[0])
    first, last = (round((at_s - before_s) / comparison.sampling_interval_s) for at_s in span)
    text = (
        f"of {len(comparison.pv):,} samples, those from {span[0]:g} to {span[1]:g} s are explained, which the audit "
        "judges; seconds count from their start"
    )
    part = comparison.part(slice(max(first, 0), last + 1))
    return replace(part, notes=(*comparison.notes, Reason("part_explained", text)))


def _recorded(comparison: Comparison) -> Recording:
    time_s = np.arange(len(comparison.pv), dtype=np.float64) * comparison.sampling_interval_s
    pv = comparison.pv.copy()
    if comparison.known is not None:
        pv[~comparison.known] = np.nan
    return Recording(comparison.name, time_s, pv, comparison.op, comparison.sp)
