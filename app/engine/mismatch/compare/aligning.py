"""Simulated traces laid onto the samples of a recording."""

from dataclasses import dataclass

import numpy as np

from app.counting import counted
from app.engine.evidence import Reason
from app.engine.recording import FloatArray
from app.errors import DataError

_SLACK_INTERVALS = 1.5


@dataclass(frozen=True, eq=False)
class Aligned:
    """A simulated PV (N,) at the recording's samples, and what is to be said of how it came there."""

    trace: FloatArray
    notes: tuple[Reason, ...] = ()


def sample_by_sample(samples: int, trace: FloatArray) -> Aligned:
    """A simulated trace without times, or for a recording without: a value a sample. Raises where their numbers
    differ.
    """
    if len(trace) != samples:
        raise DataError(
            "simulation_length",
            f"the simulation has {len(trace):,} samples, the recording {samples:,}; without times in both they must be "
            "the same",
        )
    return onto(np.arange(samples, dtype=np.float64), np.arange(samples, dtype=np.float64), trace)


def onto(time: FloatArray, other_time: FloatArray, trace: FloatArray) -> Aligned:
    """A simulated trace at the recording's times; what it covers before and after them is left out, and said.

    time: (N,) s. other_time, trace: (M,) s and the unit of PV. Raises DataError("simulation_not_finite",
    "no_overlap", "simulation_length") where the trace has holes or does not cover the recording.
    """
    known = np.isfinite(trace) & np.isfinite(other_time)
    if known.sum() < 2:
        raise DataError("simulation_not_finite", "the simulation has no values")
    if holes := int(np.sum(~known[np.argmax(known) : len(known) - np.argmax(known[::-1])])):
        raise DataError(
            "simulation_not_finite",
            counted(
                holes,
                "sample of the simulation between others has no value",
                "samples of the simulation between others have no value",
            ),
        )
    if len(other_time) == len(time) and other_time[0] == 0.0:
        other_time = other_time + time[0]
    order = np.flatnonzero(known)[np.argsort(other_time[known], kind="stable")]
    at, values = other_time[order], trace[order]
    own = np.sort(time[np.isfinite(time)])
    return Aligned(np.interp(time, at, values), covering(own, at) if len(own) > 1 else ())


def covering(time: FloatArray, at: FloatArray) -> tuple[Reason, ...]:
    """What a simulation at the times `at` (M,) s covers beyond the recording's (N,) s, both in order.

    Raises DataError("no_overlap", "simulation_length") where it does not cover the recording.
    """
    begin, end = float(time[0]), float(time[-1])
    slack = _SLACK_INTERVALS * float(np.median(np.diff(time)))
    first, last = float(at[0]), float(at[-1])
    if first > end or last < begin:
        raise DataError(
            "no_overlap",
            f"simulation ({first:.12g} to {last:.12g} s) and recording ({begin:.12g} to {end:.12g} s) do not overlap",
        )
    if first > begin + slack or last < end - slack:
        raise DataError("simulation_length", _covered(begin, end, first, last))
    return beyond(begin, end, at, slack)


def beyond(begin: float, end: float, at: FloatArray, slack: float = 0.0) -> tuple[Reason, ...]:
    """That the samples of a simulation at the times `at` (M,) s outside the recording's stretch are not compared."""
    outside = int(np.sum((at < begin - slack) | (at > end + slack)))
    if not outside:
        return ()
    text = _covered(begin, end, float(np.min(at)), float(np.max(at)))
    left_out = counted(outside, "of its samples lies outside and is", "of its samples lie outside and are")
    return (Reason("simulation_cut", f"{text}; {left_out} not compared"),)


def _covered(begin: float, end: float, first: float, last: float) -> str:
    return (
        f"the simulation covers {first - begin:.6g} to {last - begin:.6g} s from the recording's start, the recording "
        f"0 to {end - begin:.6g} s"
    )
