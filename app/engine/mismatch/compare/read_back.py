"""Whether a measured signal is the valve's own position: it answers OP through a stem that sticks, and OP moves PV
through it alone. A cause that OP answers by feedforward stands and jumps along with OP too, but leaves OP an effect.

A Granger test by linear pasts takes it for a cause, because no linear past of OP tells when a stem slips.
"""

from dataclasses import dataclass, replace

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.compare.comparison import Comparison
from app.engine.mismatch.loop.causing import stands_for_op
from app.engine.recording import FloatArray
from app.engine.valve import two_parameter_he

_OWN_PAST = 3
_S_SHARES = np.geomspace(0.01, 1.0, 40)  # of the range of OP
_JUMPS = np.array([0.0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0])  # J / S
_MOST_SAMPLES = 20_000  # of a longer record the newest
_LEFT = 0.85
"""Share that the slips of a stem may leave of what a signal's own past does not tell. Measured causes of 120 blind
loops (noise, sines, triangles, squares) keep 0.93 and more of it, positions of 33 of 36 valves 0.05 to 0.82; slow
physical valves sampled once a second are missed."""


@dataclass(frozen=True)
class _Stem:
    """The valve that reads a signal best. S: unit of OP. left: share of the signal's innovations that it leaves;
    left_by_op: share that OP itself leaves.
    """

    S: float
    left: float
    left_by_op: float

    @property
    def sticks(self) -> bool:
        return self.left < _LEFT * min(1.0, self.left_by_op)


def without_read_backs(comparison: Comparison) -> Comparison:
    """The comparison without the measured signals that are the position of a valve that sticks, each said in a note."""
    newest = slice(-_MOST_SAMPLES, None)
    op, pv = comparison.op[newest], comparison.pv[newest]
    seen = np.ones(len(pv), dtype=np.bool_) if comparison.known is None else comparison.known[newest]
    moving = [(name, signal[newest]) for name, signal in comparison.measured if np.ptp(signal[newest]) > 0.0]
    stems = {name: (signal, best_stem(signal, op)) for name, signal in moving}
    found = {name: stem for name, (x, stem) in stems.items() if stem.sticks and stands_for_op(x, op, pv, seen)}
    said = tuple(
        Reason(
            "read_back",
            f"{name} sticks and slips like the stem of a valve driven by OP (S {stem.S:.3g} of OP fits "
            "best): it is the valve's position, not a cause of its own",
        )
        for name, stem in found.items()
    )
    kept = tuple((name, signal) for name, signal in comparison.measured if name not in found)
    return replace(comparison, measured=kept, notes=(*comparison.notes, *said))


def best_stem(signal: FloatArray, op: FloatArray) -> _Stem:
    """The valve of a grid whose moves say most of a signal (N,) beyond its own past. op: (N,), moving.

    Misleads on a stem that moves less than the noise of its read-back.
    """
    own = _past(signal)
    surprise = signal[_OWN_PAST:] - own @ (own.T @ signal[_OWN_PAST:])
    span = float(np.ptp(op))
    best = _Stem(0.0, np.inf, float(_left_by(np.diff(op)[None, _OWN_PAST - 1 :], own, surprise)[0]))
    for S in _S_SHARES * span:
        slips = np.diff(two_parameter_he(op, np.full(len(_JUMPS), S), S * _JUMPS))[:, _OWN_PAST - 1 :]
        left = _left_by(slips, own, surprise)
        if left.min() < best.left:
            best = replace(best, S=float(S), left=float(left.min()))
    return best


def _past(signal: FloatArray) -> FloatArray:
    """(N - _OWN_PAST, P) orthonormal basis of a constant and a signal's last samples."""
    n = len(signal)
    around = signal - np.mean(signal)
    columns = [np.ones(n - _OWN_PAST), *(around[_OWN_PAST - k : n - k] for k in range(1, _OWN_PAST + 1))]
    return np.linalg.qr(np.stack(columns, axis=1))[0]


def _left_by(moves: FloatArray, own: FloatArray, surprise: FloatArray) -> FloatArray:
    """(M,) shares of a surprise (N,) that moves (M, N) leave, what its own past (N, P) tells of them taken off."""
    fresh = moves - (moves @ own) @ own.T
    along = (fresh @ surprise) ** 2
    whole = np.sum(fresh * fresh, axis=1) * float(surprise @ surprise)
    return 1.0 - np.divide(along, whole, out=np.zeros(len(moves)), where=whole > 1e-12 * np.max(whole, initial=1e-300))
