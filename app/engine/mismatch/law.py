"""The controller's law, read off SP, PV and OP."""

from dataclasses import dataclass

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


def identify_law(
    sp: FloatArray | None, pv: FloatArray, op: FloatArray, usable: BoolArray | None = None
) -> Law:
    """The incremental PID law by least squares over the samples where OP moves. sp, pv, op: (N,). usable: (N,) False
    where PV was filled in or is at fault.

    Without SP it is taken for constant, and its value comes out with the law.
    """
    e = -pv if sp is None else sp - pv
    columns = [e[2:] - e[1:-1], e[2:], e[2:] - 2.0 * e[1:-1] + e[:-2]]
    columns += [np.ones(len(e) - 2)] if sp is None else []
    basis = np.stack(columns, axis=1)
    moves = np.diff(op)[1:]
    kept = moves != 0.0
    if usable is not None:
        kept &= usable[2:] & usable[1:-1] & usable[:-2]
    if kept.sum() < 20:
        return Law(0.0, 0.0, 0.0, 0.0)
    numbers = np.linalg.lstsq(basis[kept], moves[kept], rcond=None)[0]
    left = moves[kept] - basis[kept] @ numbers
    explained = float(1.0 - np.var(left) / max(np.var(moves[kept]), 1e-300))
    kc, ki, kd = numbers[:3].tolist()
    if sp is not None:
        return Law(kc, ki, kd, explained)
    if ki == 0.0:
        return Law(0.0, 0.0, 0.0, 0.0)
    return Law(kc, ki, kd, explained, float(numbers[3]) / ki)
