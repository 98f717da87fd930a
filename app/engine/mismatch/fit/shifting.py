"""A simulated trace whose time is not the recording's: early, it answers OP before OP moved; late, it begins with a
stretch that answers no OP of the record. No parameter of a model mends either.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.counting import counted
from app.engine.evidence import Reason, in_digits
from app.engine.mismatch.fit.given import TraceModel, behind_trace
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.recording import FloatArray

_LEAST_SAMPLES, _MOST_SAMPLES, _MOST_SHARE = 3, 1000, 0.2  # of the record: beyond, too little is left to see it by
_LEFT, _HELPS = 0.05, 0.5  # what a linear model leaves of a trace that answers OP; by how much a shift must lessen it


@dataclass(frozen=True, eq=False)
class InStep:
    """The linear model behind a trace that is in step with the record, and by how much (s) it was moved later for
    that.
    """

    behind: TraceModel
    said: tuple[Reason, ...] = ()
    early_s: float = 0.0


def in_step(record: Experiment, trace: FloatArray) -> InStep:
    """The model behind a simulated trace (N,); behind the trace moved to where PV is, where only that answers OP."""
    behind = behind_trace(record, trace)
    if behind.share <= _LEFT:
        return InStep(behind)
    n, early = record.samples, _samples_early(record, trace)
    if abs(early) < _LEAST_SAMPLES:
        return InStep(behind)
    first, last = max(early, 0), n + min(early, 0)
    again = behind_trace(record.stretch(first, last), trace[first - early : last - early])
    if again.share > _HELPS * behind.share:
        return InStep(behind)
    rest = np.concatenate((np.zeros(first), again.rest, np.zeros(n - last)))
    said = (_in_words(record, early, behind.share, again.share),)
    return InStep(replace(again, rest=rest), said, early * record.sampling_interval_s)


def _in_words(record: Experiment, early: int, before: float, after: float) -> Reason:
    side, other = ("early", "later") if early > 0 else ("late", "earlier")
    moved = f"{counted(abs(early), 'sample')} ({abs(early) * record.sampling_interval_s:.4g} s) {other}"
    left = f"{in_digits(100.0 * after, 2)} % of it unexplained, and unshifted {in_digits(100.0 * before, 2)} %"
    text = (
        f"the simulation is {side} and was compared {moved}: there a linear model of OP leaves {left}; are its times "
        "those of the recording?"
    )
    return Reason("simulation_shifted", text)


def _samples_early(record: Experiment, trace: FloatArray) -> int:
    """By how many samples a trace (N,) is to be moved later for PV to resemble it most; earlier where negative."""
    n, most = record.samples, min(int(_MOST_SHARE * record.samples), _MOST_SAMPLES)
    shifts = sorted(range(-most, most + 1), key=abs)
    alike = []
    for early in shifts:
        first, last = max(early, 0), n + min(early, 0)
        seen = record.usable[first:last]
        pv, moved = record.pv[first:last][seen], trace[first - early : last - early][seen]
        there = len(pv) > 1 and np.ptp(pv) > 0.0 and np.ptp(moved) > 0.0
        alike.append(float(np.corrcoef(pv, moved)[0, 1]) if there else -1.0)
    return shifts[int(np.argmax(alike))]
