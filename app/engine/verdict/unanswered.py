"""A PV that does not answer at all while OP moves: a stuck valve, or a dead transmitter."""

import numpy as np

from app.engine.causality.stuck_stem import StuckStem
from app.engine.codes import UNANSWERED
from app.engine.evidence import Reason, in_digits
from app.engine.fitness.config import FEWEST_VALUES
from app.engine.fitness.standstill import Standstill
from app.engine.judgement import ANSWERS_NO_MORE, PV_STANDS, Judgement
from app.engine.recording import BoolArray, FloatArray, Recording

# What a plant finds when it looks is a stuck valve a little more often than a dead transmitter: a prior, not a fit.
PRIOR = 0.6
_OFF_SHARE = 0.5
_SAME_SHARE = 1e-6
_LAST_DIGITS = float(np.finfo(np.float32).eps)
_TEXT = "OP moves and PV does not answer at all: the valve is stuck or the transmitter is dead; check both"


def unanswered(recording: Recording) -> Judgement:
    """The judgement on a recording whose PV was refused as flat, and for no other reason.

    If the recording itself shows a controller at work while PV stands still (in automatic by its mode, SP away from PV
    for most of the time, OP on ten values or more), only a stuck valve or a dead transmitter is left. The verdict is
    then "inconclusive", with the prior between the two. Otherwise it is "not_auditable": a flat PV may also be a signal
    that nobody maintains. It is never reliable.
    """
    reason = Reason("pv_does_not_answer", _TEXT)
    if not _controller_works(recording):
        return Judgement("not_auditable", None, "not_reliable", (reason,), UNANSWERED)
    return _between_the_two(reason)


def standing(found: Standstill) -> Judgement:
    """The judgement on a recording in which PV stands still up to the end, whatever it did before."""
    text = f"{found.text}: unless the unit is shut down, the transmitter is dead or the valve is stuck; check both"
    return _between_the_two(Reason(PV_STANDS, text), found.for_s, None if found.from_start else found.since_s)


def stuck(found: StuckStem) -> Judgement:
    """The judgement on a record in which PV moves but has stopped answering OP, whatever it did before."""
    answered = "answered neither OP nor SP" if found.sp_moved else "not answered OP"
    text = (
        f"PV has {answered} for the last {in_digits(found.for_s / 3600.0, 3)} h, while OP covered "
        f"{in_digits(found.times, 2)} times its earlier range and PV did not come back: "
        "the stem is stuck, or the transmitter reads something else; check both"
    )
    return _between_the_two(Reason(ANSWERS_NO_MORE, text), found.for_s, found.since_s)


def _between_the_two(reason: Reason, for_s: float | None = None, since_s: float | None = None) -> Judgement:
    prior = Reason("prior_only", f"the probability {PRIOR:g} is a prior for the two causes, not a measurement")
    reasons = (reason, prior)
    return Judgement(
        "inconclusive", PRIOR, "not_reliable", reasons, UNANSWERED, unanswered_s=for_s, unanswered_since_s=since_s
    )


def _controller_works(recording: Recording) -> bool:
    if recording.automatic is None or recording.sp is None:
        return False
    known = np.isfinite(recording.pv) & np.isfinite(recording.op) & np.asarray(recording.automatic, dtype=bool)
    pv, op, sp = recording.pv[known], recording.op[known], recording.sp[known]
    if len(np.unique(op)) < FEWEST_VALUES or len(np.unique(pv)) != 1:
        return False
    return float(np.mean(_away(pv, sp))) >= _OFF_SHARE


def _away(pv: FloatArray, sp: FloatArray) -> BoolArray:
    """(N,) where SP is not PV, measured by how far it ever is: an offset of both changes nothing."""
    distance = np.where(np.isfinite(sp), np.abs(sp - pv), 0.0)
    farthest, largest = float(np.max(distance, initial=0.0)), float(np.max(np.abs(pv), initial=0.0))
    # What differs in the last digits of a float of 32 bits only is the same set point.
    return distance > _SAME_SHARE * farthest if farthest > _LAST_DIGITS * largest else np.zeros(len(pv), dtype=bool)
