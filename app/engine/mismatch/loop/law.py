"""The controller's law: read off SP, PV and OP, or as somebody gives it."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.recording import BoolArray, FloatArray


@dataclass(frozen=True)
class Law:
    """OP(t) - OP(t-1) = kc (e(t) - e(t-1)) + ki e(t) + kd (e(t) - 2 e(t-1) + e(t-2)), e = SP - PV.

    kc, ki, kd: unit of OP per unit of PV. explained: share of the variance of OP's moves that the law explains.
    sp: the set point that PV and OP speak of, where none was recorded; None where SP was recorded.
    """

    kc: float
    ki: float
    kd: float
    explained: float
    sp: float | None = None

    def at_interval(self, from_s: float, to_s: float) -> "Law":
        """The same controller at another interval."""
        if from_s == to_s:
            return self
        return replace(self, ki=self.ki * to_s / from_s, kd=self.kd * from_s / to_s)


@dataclass(frozen=True)
class Controller:
    """A PID as its face shows it: OP = gain (e + integral of e / Ti + Td de/dt), e = SP - PV.

    gain: unit of OP per unit of PV, negative where the process has a negative gain. integral_time_s: None without
    integral action.
    """

    gain: float
    integral_time_s: float | None = None
    derivative_time_s: float = 0.0

    def law(self, sampling_interval_s: float) -> Law:
        ki = 0.0 if self.integral_time_s is None else self.gain * sampling_interval_s / self.integral_time_s
        return Law(self.gain, ki, self.gain * self.derivative_time_s / sampling_interval_s, 0.0)


def controller_of(law: Law, sampling_interval_s: float) -> Controller:
    """A law as a controller's face shows it."""
    if law.kc == 0.0:
        return Controller(0.0)
    integral = law.kc * sampling_interval_s / law.ki if law.ki != 0.0 else None
    return Controller(law.kc, integral, law.kd * sampling_interval_s / law.kc)


def terms(e: FloatArray) -> FloatArray:
    """(N - 2, 3) what kc, ki and kd multiply of the error (N,), from its third sample on."""
    return np.stack([e[2:] - e[1:-1], e[2:], e[2:] - 2.0 * e[1:-1] + e[:-2]], axis=1)


def tried_on(law: Law, sp: FloatArray, pv: FloatArray, op: FloatArray, usable: BoolArray | None = None) -> Law:
    """The law with the share of OP's moves that it explains, where OP moves and PV is usable; not below 0."""
    moves = np.diff(op)[1:]
    kept = answers(moves, usable)
    if not kept.any():
        return replace(law, explained=0.0)
    left = moves - terms(sp - pv) @ np.array([law.kc, law.ki, law.kd])
    return replace(law, explained=max(share_explained(moves[kept], left[kept]), 0.0))


def answers(moves: FloatArray, usable: BoolArray | None) -> BoolArray:
    """(N - 2,) True where OP moves and the three samples of PV that a law answers are usable (N,); None: all are."""
    if usable is None:
        return moves != 0.0
    return (moves != 0.0) & usable[2:] & usable[1:-1] & usable[:-2]


def share_explained(moves: FloatArray, left: FloatArray) -> float:
    return 1.0 - float(np.var(left)) / max(float(np.var(moves)), 1e-300)


def identify_law(sp: FloatArray | None, pv: FloatArray, op: FloatArray, usable: BoolArray | None = None) -> Law:
    """The incremental PID law by least squares over the samples where OP moves. sp, pv, op: (N,). usable: (N,) False
    where PV was filled in or is at fault.

    Without SP it is taken for constant, and its value comes out with the law.
    """
    e = -pv if sp is None else sp - pv
    columns = terms(e)
    basis = columns if sp is not None else np.column_stack((columns, np.ones(len(columns))))
    moves = np.diff(op)[1:]
    kept = answers(moves, usable)
    if kept.sum() < 20:
        return Law(0.0, 0.0, 0.0, 0.0)
    numbers = np.linalg.lstsq(basis[kept], moves[kept], rcond=None)[0]
    left = moves[kept] - basis[kept] @ numbers
    explained = share_explained(moves[kept], left)
    kc, ki, kd = numbers[:3].tolist()
    if sp is not None:
        return Law(kc, ki, kd, explained)
    if ki == 0.0:
        return Law(0.0, 0.0, 0.0, 0.0)
    return Law(kc, ki, kd, explained, float(numbers[3]) / ki)
