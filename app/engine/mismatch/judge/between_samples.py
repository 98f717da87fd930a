"""What a stem did between the samples. A free run lets it slip at a sample; on a plant the valve follows OP at every
scan of its controller, of which a record keeps one in many, and the sizes that explain the samples best are others.
"""

from dataclasses import replace

import numpy as np

from app.engine.mismatch.judge.result import Estimate
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.law import identify_law
from app.engine.oscillation import detect
from app.engine.quantification import Interval, quantify
from app.engine.recording import UniformRecord

COMPUTED = 1e-6  # of the variance of OP's moves: a law that leaves more, or that had rounded samples, is not proven


def every_scan_recorded(record: Experiment) -> bool:
    """Whether the stem saw no other OP than the recorded one: a controller's law makes each move of OP out of the
    samples themselves. Misleads where PV or OP is rounded: it says no.
    """
    law = identify_law(record.sp, record.pv, record.op, record.usable)
    return law.explained >= 1.0 - COMPUTED


def by_prediction(record: Experiment) -> Interval | None:
    """The 95 % interval of S by PV's prediction from OP, as an audit states it, unit of OP; None where no cycle shows.
    It allows for other forms of the valve and for the scans between the samples.
    """
    uniform = UniformRecord(record.sampling_interval_s, record.pv, record.op, record.sp, ~record.usable)
    size = quantify(uniform, detect(uniform))
    return None if size is None else size.interval()


def between_samples_too(size: Estimate, record: Experiment) -> Estimate:
    """A size of a stem by free runs, its interval as wide as that by prediction has it too where scans may lie between
    the samples. Where no cycle shows, nothing is known of them, and the interval stays.
    """
    if not np.ptp(record.op) > 0.0 or every_scan_recorded(record):
        return size
    told = by_prediction(record)
    if told is None:
        return size
    most = max(size.high, min(told.high, record.op_range))  # behind a wider band no reversal moves the stem
    return replace(size, low=min(size.low, told.low), high=most)
