"""The controller's law: read off SP, PV and OP, or as somebody gives it; and whether any law at all is in OP."""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.recording import BoolArray, FloatArray

_PAST = 6  # samples
_MOST_LEFT, _LEFT_BY_PV = 0.2, 0.5
_SHARED, _SURE = 0.05, 3.0
_PREDICTED = 1e-3  # of the variance of OP's moves: what a smooth OP leaves of its past's foresight is no news


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


def _terms(e: FloatArray) -> FloatArray:
    """(N - 2, 3) what kc, ki and kd multiply of the error (N,), from its third sample on."""
    return np.stack([e[2:] - e[1:-1], e[2:], e[2:] - 2.0 * e[1:-1] + e[:-2]], axis=1)


def tried_on(law: Law, sp: FloatArray, pv: FloatArray, op: FloatArray, usable: BoolArray | None = None) -> Law:
    """The law with the share of OP's moves that it explains, where OP moves and PV is usable; not below 0."""
    moves = np.diff(op)[1:]
    kept = _answers(moves, usable)
    if not kept.any():
        return replace(law, explained=0.0)
    left = moves - _terms(sp - pv) @ np.array([law.kc, law.ki, law.kd])
    return replace(law, explained=max(_share_explained(moves[kept], left[kept]), 0.0))


def _answers(moves: FloatArray, usable: BoolArray | None) -> BoolArray:
    """(N - 2,) True where OP moves and the three samples of PV that a law answers are usable (N,); None: all are."""
    if usable is None:
        return moves != 0.0
    return (moves != 0.0) & usable[2:] & usable[1:-1] & usable[:-2]


def _share_explained(moves: FloatArray, left: FloatArray) -> float:
    return 1.0 - float(np.var(left)) / max(float(np.var(moves)), 1e-300)


def identify_law(sp: FloatArray | None, pv: FloatArray, op: FloatArray, usable: BoolArray | None = None) -> Law:
    """The incremental PID law by least squares over the samples where OP moves. sp, pv, op: (N,). usable: (N,) False
    where PV was filled in or is at fault.

    Without SP it is taken for constant, and its value comes out with the law.
    """
    e = -pv if sp is None else sp - pv
    columns = _terms(e)
    basis = columns if sp is not None else np.column_stack((columns, np.ones(len(columns))))
    moves = np.diff(op)[1:]
    kept = _answers(moves, usable)
    if kept.sum() < 20:
        return Law(0.0, 0.0, 0.0, 0.0)
    numbers = np.linalg.lstsq(basis[kept], moves[kept], rcond=None)[0]
    left = moves[kept] - basis[kept] @ numbers
    explained = _share_explained(moves[kept], left)
    kc, ki, kd = numbers[:3].tolist()
    if sp is not None:
        return Law(kc, ki, kd, explained)
    if ki == 0.0:
        return Law(0.0, 0.0, 0.0, 0.0)
    return Law(kc, ki, kd, explained, float(numbers[3]) / ki)


def follows(sp: FloatArray | None, pv: FloatArray, op: FloatArray, usable: BoolArray) -> bool:
    """Whether a PID law explains most of OP's moves by PV. A set point that jumps explains most of them by itself,
    beside the PV of any loop: of what it leaves, PV has to explain half.
    """
    left = 1.0 - identify_law(sp, pv, op, usable).explained
    if sp is None or left > _MOST_LEFT:
        return left <= _MOST_LEFT
    by_sp = identify_law(sp, np.full_like(pv, np.mean(pv)), op, usable).explained
    return left <= _LEFT_BY_PV * (1.0 - by_sp)


def fed_back(sp: FloatArray | None, pv: FloatArray, op: FloatArray, usable: BoolArray) -> bool:
    """Whether OP answers the news in PV of the same sample, whatever the law: filtered, rounded, with moves of its own.

    News is what SP and the past of OP and PV do not foretell. Within a sample it moves both where a controller answers
    PV, and where OP drives a fast process; but only in the first case one against the way in which PV goes when the
    other has moved. Source: the direct method of closed-loop identification, Ljung, System Identification, 2nd edition
    1999, chapter 13.
    """
    kept = usable.copy()
    for k in range(1, _PAST + 1):
        kept[k:] &= usable[:-k]
    at = np.flatnonzero(kept[_PAST:]) + _PAST
    signals = [(op, 1), (pv, 1), *([(sp, 0)] if sp is not None else [])]
    columns = [(x - np.mean(x))[at - k] / (np.std(x) + 1e-300) for x, first in signals for k in range(first, _PAST + 1)]
    basis, both = np.stack([np.ones(len(at)), *columns], axis=1), np.stack([op[at], pv[at]], axis=1)
    if len(at) < 2 * basis.shape[1] or np.ptp(op) <= 0.0 or np.ptp(pv) <= 0.0:
        return False
    numbers = np.linalg.lstsq(basis, both, rcond=None)[0]
    news = both - basis @ numbers
    powers = np.mean(news * news, axis=0)
    if powers[0] <= _PREDICTED * np.var(np.diff(op)) or powers[1] <= 0.0:
        return False
    shared = float(np.mean(news[:, 0] * news[:, 1]) / np.sqrt(powers[0] * powers[1]))
    of_op = np.zeros(basis.shape[1])
    of_op[1 : _PAST + 1] = 1.0
    spread = float(powers[1] * (of_op @ np.linalg.pinv(basis.T @ basis) @ of_op))
    way = float(numbers[:, 1] @ of_op)
    return shared * shared >= _SHARED and shared * way < 0.0 and way * way > _SURE * _SURE * spread
