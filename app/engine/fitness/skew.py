"""Whether PV and OP were stamped at one time, told by what is new in PV: a controller hands it on to OP at once."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.innovations import apart, innovations

ORDER = 20
MOST_SKEW = 8
"""Samples between the two stamps of one moment that are looked for, either way."""
MOST_SAMPLES = 5000
"""Of the newest samples: as many tell."""
LEAST_CORRELATION = 0.5
MOST_AT_ONCE = 0.5
"""Share of that correlation that may be there without a skew."""
LEAST_ACTION = 0.3


@dataclass(frozen=True)
class Skew:
    """How many samples OP is stamped after what it answers in PV, negative before it, and how clearly that shows.

    correlation: of what is new in OP with what is new in PV, that many samples apart; its sign is the controller's.
    """

    samples: int
    correlation: float


def skew_of(record: UniformRecord) -> Skew | None:
    """The skew of a record; None where OP shows nothing of what is new in PV at once, so that none can be told.

    What neither signal's own past foretells is compared (Haugh 1976, doi 10.1080/01621459.1976.10480353). A controller
    with proportional action hands the noise of PV on to OP within the sample in which it is taken, so that the two are
    alike there and nowhere else, with the sign of the controller. A quick process answers OP some samples later and
    just as sharply, with the other sign: it is no skew.
    """
    newest = record.part(slice(max(0, record.samples - MOST_SAMPLES), None))
    pv, op = (innovations(signal[None], ORDER) for signal in (newest.pv, newest.op))
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
    action = _action(without_skew(newest, found.samples))
    return found if np.sign(found.correlation) * action >= LEAST_ACTION else None


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


def _action(record: UniformRecord) -> float:
    """The sign of the controller, -2 to 2: OP goes with the control error where it is proportional, and its moves do
    where it integrates."""
    error = record.pv - _over(record.sp, record.pv)
    return _correlation(record.op, error) + _correlation(np.diff(record.op), error[1:])


def _over(sp: FloatArray | None, pv: FloatArray) -> FloatArray:
    """(N,) PV by a straight line over SP, which may be in another unit; 0 where SP is not known or stands."""
    if sp is None or np.ptp(sp) == 0.0:
        return np.zeros_like(pv)
    moves = sp - sp.mean()
    return moves * float(moves @ (pv - pv.mean()) / (moves @ moves))


def _correlation(one: FloatArray, other: FloatArray) -> float:
    spread = float(np.std(one) * np.std(other))
    return float(np.mean((one - one.mean()) * (other - other.mean()))) / spread if spread > 0.0 else 0.0
