"""Our own linear loop found again behind a stem that sticks: found from OP it has the stem's work in it, a dead time
and a lag that the process has not, and no fit of the stem leaves that hill.
"""

import numpy as np

from app.engine.mismatch.experiment import Experiment
from app.engine.mismatch.fitting import Fit, fit, left_of
from app.engine.mismatch.given import identify
from app.engine.mismatch.task import OWN_DEVIATION, make_task, start_at
from app.engine.oscillation import detect
from app.engine.quantification import quantify
from app.engine.recording import UniformRecord
from app.engine.valve import two_parameter_he

STICKS = "valve.stiction"
SHARES = (0.1, 0.4, 1.0)  # J / S
WORTH_IT = 1.0  # nat


def behind_the_stem(found: Fit) -> Fit:
    """The same model fitted from a loop that was found behind stems of the size that the limit cycle shows, where that
    is likelier and its free run nearer to PV; the fit as it is where a simulation was given, where anything stands
    beside the stem, and where the record shows no size.
    """
    if found.given.deviation < OWN_DEVIATION or [part.block.code for part in found.parts] != [STICKS]:
        return found
    S = size_shown(found.record)
    others = [] if S is None else [found_behind(found, S, share) for share in SHARES]
    best = max((other for other in others if other is not None), key=lambda other: other.likelihood, default=found)
    likelier = best.likelihood > found.likelihood + WORTH_IT
    return best if likelier and left_of(best) < left_of(found) else found


def size_shown(record: Experiment) -> float | None:
    """S of the limit cycle, unit of OP, by prediction errors, which ask for no plant; None where there is none."""
    still = np.zeros(record.samples, dtype=np.bool_)
    uniform = UniformRecord(record.sampling_interval_s, record.pv, record.op, record.sp, still)
    size = quantify(uniform, detect(uniform))
    return None if size is None else size.S


def found_behind(found: Fit, S: float, share: float) -> Fit | None:
    """The model fitted from a linear loop behind the stem of a size; None where that stem never moves."""
    record = found.record
    stem = two_parameter_he(record.op, np.array([S]), np.array([share * S]))[0]
    if np.ptp(stem) <= 0.0:
        return None
    base = identify(record.with_op(stem), found.given.integrating)
    task = make_task(record, base.given, tuple(part.block for part in found.parts))
    return fit(task, start_at(task, base.plant, np.array([S, share, 0.0])))
