"""What a given simulated trace holds beside its linear model, along another recording: a curved valve of the simulator,
say, which the refitted and the explained simulation keep.
"""

from dataclasses import dataclass

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.compare.preparing import Prepared
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.loop.experiment import Experiment, alike
from app.engine.mismatch.loop.plant import run_process
from app.engine.recording import FloatArray

_LITTLE = 0.5  # of what the free run leaves of PV: without so much its error grows by an eighth at most


@dataclass(frozen=True)
class Lacking:
    """What is said of a second recording along which that is not known; too_much: without it nothing can be judged."""

    too_much: bool = False
    said: tuple[Reason, ...] = ()


def rest_along(prepared: Prepared, second: Experiment, trace: FloatArray | None) -> FloatArray | None:
    """(N,) what the trace (N,) of a second record holds beside the linear model behind the first one's, unit of PV;
    None where there is no such trace to tell it, or it is shorter than it is late; zeros where the first one's is
    linear.

    Only the model's start is the second record's own.
    """
    laid = prepared.laid
    if laid is None or not np.any(laid.behind.rest):
        return np.zeros(second.samples)
    if trace is None:
        return None
    behind, ts = laid.behind, second.sampling_interval_s
    at = np.arange(second.samples, dtype=np.float64)
    moved = at - laid.early_s / ts
    there = (moved >= 0.0) & (moved <= at[-1])
    if not there.any():
        return None
    u = alike(prepared.record, second).op_deviation
    settled = behind.plant.changed(x0=0.0, speed0=0.0)
    left = np.interp(moved, at, trace) - behind.level - run_process(u, settled, ts)
    still = settled.changed(K=0.0, b=0.0)
    columns = [run_process(np.zeros_like(u), still.changed(**{state: 1.0}), ts) for state in settled.states]
    begun = np.stack(columns, axis=1)
    starts = np.linalg.lstsq(begun[there], left[there], rcond=None)[0]
    rest = np.where(there, prepared.share * (left - begun @ starts), 0.0)
    return rest if prepared.bent is None else prepared.bent.along(rest, ts)


def rest_unknown(prepared: Prepared, final: Fit) -> Lacking:
    """What that is for a second record without a trace: no more than a note where a free run leaves far more of PV
    anyhow.
    """
    seen = prepared.record.usable
    rest, left = (float(np.sqrt(np.mean(signal[seen] ** 2))) for signal in (prepared.record.rest, final.residual))
    holds = f"the given simulation contains {rest:.3g} (root mean square, unit of PV) beyond a linear model"
    if rest > _LITTLE * left:
        text = f"{holds}, and the second recording has none: nothing can be simulated there"
        return Lacking(True, (Reason("second_not_simulated", text),))
    text = f"{holds}, and the second recording has none: what is simulated there lacks that part"
    return Lacking(said=(Reason("second_not_simulated", text),))
