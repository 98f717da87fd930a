"""What is said of the controller: cleared by its own law, tuned otherwise than the simulation's, or not judged."""

from app.engine.evidence import Reason
from app.engine.mismatch.fit.closed_loop import ClosedLoop
from app.engine.mismatch.fit.windows import whole
from app.engine.mismatch.judge.result import NOWHERE, Location
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.law import Law, controller_of

_NO_DERIVATIVE = 1e-3  # of the interval: what rounding leaves of it


def controller_evidence(record: Experiment, closed: ClosedLoop | None) -> tuple[Reason, ...]:
    """A controller whose law explains its output is cleared, and compared with that of the given simulation; one whose
    law was not found is not accused.
    """
    if closed is None:
        text = "no PID law of PV and SP explains OP: the controller is not judged, nor the closed loop simulated"
        return (Reason("controller_not_evaluated", text),)
    law = closed.law
    text = (
        f"SP and PV explain {100.0 * law.explained:.2f} % of OP's moves by a PID law: the controller works as it should"
    )
    if law.sp is not None:
        text += f"; SP was not recorded and is assumed constant at {law.sp:.5g}"
    return (Reason("controller_cleared", text), *_tuned_otherwise(record, closed))


def _tuned_otherwise(record: Experiment, closed: ClosedLoop) -> tuple[Reason, ...]:
    """That the given simulation's controller is another than the recorded one; nothing where it is the same, or where
    the simulation has none.
    """
    if closed.given_law is None or not closed.controller_differs:
        return ()
    own, given = in_words(closed.law, record), in_words(closed.given_law, record)
    text = (
        f"the simulation's controller ({given}) explains {100.0 * closed.given_law.explained:.0f} % of OP's moves; the "
        f"recorded one is tuned differently ({own})"
    )
    return (Reason("controller_differs", text),)


def in_words(law: Law, record: Experiment) -> str:
    """Gain and times of a law."""
    shown = controller_of(law, record.sampling_interval_s)
    integral = "none" if shown.integral_time_s is None else f"{shown.integral_time_s:.4g} s"
    derivative = shown.derivative_time_s
    rate = "none" if abs(derivative) < _NO_DERIVATIVE * record.sampling_interval_s else f"{derivative:.3g} s"
    return f"gain {shown.gain:.4g} OP/PV, integral time {integral}, derivative time {rate}"


def at_the_controller(record: Experiment, closed: ClosedLoop | None) -> Location:
    """Where recording and simulation differ, when no physics is missing: at the controller, or nowhere."""
    told = () if closed is None else _tuned_otherwise(record, closed)
    if not told:
        return NOWHERE
    return Location("controller", whole(record), "always", None, told)


def yper_evidence(closed: ClosedLoop | None) -> tuple[Reason, ...]:
    """What the clean simulation lacked for Yper to come out as recorded."""
    if closed is None or not closed.lacked or closed.refitted is None:
        return ()
    text = (
        f"Yper is {closed.recorded.yper_pct:.3g} % in the record and {closed.refitted.yper_pct:.3g} % in the clean "
        f"simulation, which lacked {', then '.join(closed.lacked)}"
    )
    return (Reason("yper_lacked", text),)
