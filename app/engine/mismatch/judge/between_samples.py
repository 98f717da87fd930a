"""What a stem did between the samples. A free run lets it slip at a sample; on a plant the valve follows OP at every
scan of its controller, of which a record keeps one in many, and the sizes that explain the samples best are others.
"""

from dataclasses import replace

import numpy as np

from app.engine.fitness.signals import at_extremes
from app.engine.mismatch.fit.levels import decimals_of
from app.engine.mismatch.judge.result import Estimate
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.oscillation import detect
from app.engine.quantification import Interval, quantify
from app.engine.recording import BoolArray, FloatArray, UniformRecord

_LIKE_A_NUMBER = 1e-4  # of the deviation of a signal's moves: rounded no coarser, and it is as it was computed
_UNSEEN = 0.25  # of the variance ki^2 of PV's noise; (m - 1)/m^2 + (1 - 1/m)^2/3, a third at least, by m scans a sample
_SURE = 3.0  # deviations
_SIXTH = 924.0  # the variance of sixth differences of white noise, over its own
_OF_MEDIAN = 0.455  # the median of the square of a normal number


def every_scan_recorded(record: Experiment) -> bool:
    """Whether the stem saw no other OP than the recorded one: a controller's law makes each move of OP out of the
    samples themselves and leaves no more than their rounding, while scans between them would leave more, because PV's
    noise there is in OP and in no sample. False where that cannot be told.

    The law is the one that leaves least over what rounding lets it leave (total least squares): rounding is in PV as
    well, and would bend the gains of one that leaves least. Misleads where PV's noise is slower than the samples.
    """
    kept = _answering(record)
    doubt = _SURE * float(np.sqrt(3.0 / max(int(np.sum(kept)), 1)))  # two moves share the rounding of a sample
    if not doubt < 1.0:
        return False
    of_op, of_pv = _rounding(record.op[record.usable]), _rounding(record.pv[record.usable])
    if not min(of_op, of_pv) > 0.0:
        return False
    exact = np.ones((int(np.sum(kept)), 1))
    if record.sp is not None:
        exact = np.column_stack((exact, _latest(record.sp - np.mean(record.sp))[kept]))
    seen = np.column_stack((np.diff(record.op)[1:], _latest(record.pv - record.pv_mid)))[kept]
    seen -= exact @ np.linalg.lstsq(exact, seen, rcond=None)[0]
    spreads = np.sqrt([2.0 * of_op, of_pv, of_pv, of_pv])
    _, singular, ways = np.linalg.svd(seen / spreads, full_matrices=False)
    left = float(singular[-1] ** 2) / len(seen)  # over what rounding leaves
    integral = float(np.sum(ways[-1, 1:] / spreads[1:]))
    unseen = _UNSEEN * integral**2 * max(_noise(record) - of_pv, 0.0)
    return left <= 1.0 + doubt <= unseen  # where a controller saw PV rounded too, rounding leaves less


def _latest(signal: FloatArray) -> FloatArray:
    """(N - 2, 3) a signal's samples that a law answers, from the third on."""
    return np.stack([signal[2:], signal[1:-1], signal[:-2]], axis=1)


def _answering(record: Experiment) -> BoolArray:
    """(N - 2,) True where a law is answered: PV is usable, and OP neither is nor was where it goes no further."""
    least, most = at_extremes(record.op)
    free, usable = ~(least | most), record.usable
    return free[2:] & free[1:-1] & usable[2:] & usable[1:-1] & usable[:-2]


def _rounding(signal: FloatArray) -> float:
    """The variance of a signal's rounding; 0 where it stands."""
    if len(signal) < 2:
        return 0.0
    step = max(decimals_of(signal), _LIKE_A_NUMBER * float(np.std(np.diff(signal))))
    return step * step / 12.0


def _noise(record: Experiment) -> float:
    """The variance of what is in one sample of PV and not in those around it, rounding included."""
    usable = np.lib.stride_tricks.sliding_window_view(record.usable, 7).all(axis=1)
    moved = np.diff(record.pv, 6)[usable]
    return float(np.median(moved * moved)) / (_OF_MEDIAN * _SIXTH) if len(moved) else 0.0


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
