"""Whether PV and OP were stamped at one time, told by what is new in PV: a controller hands it on to OP at once."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.innovations import apart, innovations
from app.engine.signals.sampled import correlation

ORDER = 20
MOST_SKEW = 8
"""Samples between the two stamps of one moment that are looked for, either way."""
MOST_SAMPLES = 5000
"""Of the newest samples: as many tell."""
LEAST_CORRELATION = 0.5
MOST_AT_ONCE = 0.5
"""Share of that correlation that may be there without a skew."""
LEAST_ACTION, LEAST_INTEGRAL, MOST_ALONG = 0.3, 0.05, 0.8
"""Correlations that tell a controller from a process: of OP and its moves with the control error, of the moves alone,
and of OP with a PV that may follow it."""


@dataclass(frozen=True)
class Skew:
    """How many samples OP is stamped after what it answers in PV, negative before it, and how clearly that shows.

    correlation: of what is new in OP with what is new in PV, that many samples apart; its sign is the controller's.
    """

    samples: int
    correlation: float


def skew_of(record: UniformRecord) -> Skew | None:
    """The skew of a record; None where OP shows nothing of what is new in PV at once, so that none can be told.

    What neither signal's own past foretells is compared (Haugh 1976, doi 10.1080/01621459.1976.10480353), less what a
    proportional controller makes of a moving set point at once. A controller with proportional action hands the noise
    of PV on to OP within the sample in which it is taken, so that the two are alike there and nowhere else, with the
    sign of the controller. A quick process answers OP some samples later and just as sharply: with the other sign where
    the loop is closed around it, and with the same one where OP is moved by something else (a set point that is not
    recorded, a program, by hand). Where the two cannot be told apart, nothing is told.

    Misleads: feed-forward moves OP ahead of PV as a PV that is stamped late does.
    """
    newest = record.part(slice(max(0, record.samples - MOST_SAMPLES), None))
    pv, op = (innovations(signal[None], ORDER) for signal in (newest.pv, newest.op - _kicks(newest)))
    if pv is None or op is None:
        return None
    lags = range(-MOST_SKEW, MOST_SKEW + 1)
    alike = np.array([float(np.vdot(*apart(op[0], pv[0], lag))) for lag in lags])
    most = int(np.argmax(np.abs(alike)))
    found = Skew(lags[most], float(alike[most]))
    if abs(found.correlation) < LEAST_CORRELATION:
        return None
    if found.samples == 0 or abs(alike[MOST_SKEW]) > MOST_AT_ONCE * abs(found.correlation):
        return Skew(0, float(alike[MOST_SKEW]))
    return (
        found if found.samples > 0 or _acts(without_skew(newest, found.samples), np.sign(found.correlation)) else None
    )


def without_skew(record: UniformRecord, samples: int) -> UniformRecord:
    """The record with each OP beside the PV that it answers, at the later of their stamps. The set point stays with
    OP: both are the controller's."""
    n = record.samples
    pv, op = (slice(0, n - samples), slice(samples, n)) if samples >= 0 else (slice(-samples, n), slice(0, n + samples))
    return replace(
        record,
        pv=record.pv[pv],
        op=record.op[op],
        sp=None if record.sp is None else record.sp[op],
        filled=record.filled[pv] | record.filled[op],
        start_s=record.start_s + abs(samples) * record.sampling_interval_s,
    )


def _acts(record: UniformRecord, sign: float) -> bool:
    """Whether OP, beside a PV that it would answer, is that of a controller with this sign: its moves go with the
    control error midway where it integrates, and OP does where it is proportional. A PV that follows OP goes along with
    it too, but OP's moves do not go with that."""
    error = record.pv - _over(record.sp, record.pv)
    integral = sign * correlation(np.diff(record.op), error[1:] + error[:-1])
    proportional = sign * correlation(record.op, error)
    follows = sign * correlation(record.op, record.pv) > MOST_ALONG
    return bool(integral >= LEAST_INTEGRAL or (proportional + integral >= LEAST_ACTION and not follows))


def _kicks(record: UniformRecord) -> FloatArray:
    """(N,) what OP moves at once with SP, by its moves; 0 where SP is not known or stands."""
    if record.sp is None or np.ptp(record.sp) == 0.0:
        return np.zeros_like(record.op)
    moves = np.diff(record.sp)
    return (record.sp - record.sp[0]) * float(moves @ np.diff(record.op) / (moves @ moves))


def _over(sp: FloatArray | None, pv: FloatArray) -> FloatArray:
    """(N,) PV by a straight line over SP, which may be in another unit; 0 where SP is not known or stands."""
    if sp is None or np.ptp(sp) == 0.0:
        return np.zeros_like(pv)
    moves = sp - sp.mean()
    return moves * float(moves @ (pv - pv.mean()) / (moves @ moves))
