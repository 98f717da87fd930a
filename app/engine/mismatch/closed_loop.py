"""The loop closed again: the controller's law read off SP, PV and OP, and the model simulated from the recorded SP
alone.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.mismatch.chain import simulate
from app.engine.mismatch.fitting import Fit
from app.engine.oscillation import detect
from app.engine.recording import FloatArray, UniformRecord
from app.engine.yper import compute

IDENTIFIED = 0.9


@dataclass(frozen=True)
class Law:
    """OP(t) - OP(t-1) = kc (e(t) - e(t-1)) + ki e(t) + kd (e(t) - 2 e(t-1) + e(t-2)), e = SP - PV.

    kc, ki, kd: unit of OP per unit of PV. explained: share of the variance of OP's moves that the law explains.
    """

    kc: float
    ki: float
    kd: float
    explained: float


@dataclass(frozen=True)
class LoopFigures:
    """What a loop shows. period_s is None where it does not oscillate; amplitude: standard deviation of PV - SP,
    unit of PV.
    """

    period_s: float | None
    amplitude: float
    yper_pct: float


@dataclass(frozen=True)
class ClosedLoop:
    """The recorded loop beside the loops simulated from SP alone, without and with the missing physics."""

    law: Law
    recorded: LoopFigures
    refitted: LoopFigures | None
    explained: LoopFigures | None


def identify_law(sp: FloatArray, pv: FloatArray, op: FloatArray) -> Law:
    """The incremental PID law by least squares over the samples where OP moves. sp, pv, op: (N,)."""
    e = sp - pv
    basis = np.stack((e[2:] - e[1:-1], e[2:], e[2:] - 2.0 * e[1:-1] + e[:-2]), axis=1)
    moves = np.diff(op)[1:]
    kept = moves != 0.0
    if kept.sum() < 20:
        return Law(0.0, 0.0, 0.0, 0.0)
    kc, ki, kd = np.linalg.lstsq(basis[kept], moves[kept], rcond=None)[0].tolist()
    left = moves[kept] - basis[kept] @ np.array([kc, ki, kd])
    return Law(kc, ki, kd, float(1.0 - np.var(left) / max(np.var(moves[kept]), 1e-300)))


@njit(cache=True, nogil=True)
def _follow(e: FloatArray, kc: float, ki: float, kd: float, start: float, low: float, high: float) -> FloatArray:
    op = np.empty(len(e))
    op[0] = start
    for t in range(1, len(e)):
        before = e[t - 2] if t > 1 else e[t - 1]
        move = kc * (e[t] - e[t - 1]) + ki * e[t] + kd * (e[t] - 2.0 * e[t - 1] + before)
        op[t] = min(max(op[t - 1] + move, low), high)
    return op


def close(found: Fit, law: Law, sp: FloatArray) -> UniformRecord | None:
    """OP and PV of the closed loop, from SP (N,) alone; None where it has not settled on one answer.

    The model runs over whole signals, so the loop is solved by repetition: PV answers OP a sample later at the
    earliest, hence each
    pass makes at least one more sample right, and N passes make all.
    """
    record = found.record
    low, high = float(np.min(record.op)) - record.op_span, float(np.max(record.op)) + record.op_span
    op = np.full(record.samples, record.op[0])
    pv = np.full(record.samples, record.pv[0])
    for _ in range(record.samples):
        error = np.ascontiguousarray(sp - pv)
        following = _follow(error, law.kc, law.ki, law.kd, float(record.op[0]), low, high)
        change = float(np.max(np.abs(following - op)))
        op = following
        if change < 1e-9 * record.op_span:
            break
        pv = simulate(record.with_op(op), found.plant, found.parts) + record.pv_mid
    else:
        return None
    return UniformRecord(record.sampling_interval_s, pv, op, sp, np.zeros(record.samples, dtype=np.bool_))


def figures(record: UniformRecord) -> LoopFigures:
    period = detect(record).period_s
    spread = float(np.std(record.pv - record.sp)) if record.sp is not None else float(np.std(record.pv))
    if np.ptp(record.op) <= 0.0 or np.ptp(record.pv) <= 0.0:
        return LoopFigures(period, spread, 0.0)
    return LoopFigures(period, spread, compute(record.pv, record.op, record.sampling_interval_s, "std").yper_pct)


def close_again(base: Fit, final: Fit) -> ClosedLoop | None:
    """The closed loop of a record with SP, beside both simulations; None without SP or where the law is not a PID of
    the error.
    """
    record = base.record
    if record.sp is None or not np.all(np.isfinite(record.sp)):
        return None
    law = identify_law(record.sp, record.pv, record.op)
    if law.explained < IDENTIFIED:
        return None
    recorded = UniformRecord(
        record.sampling_interval_s, record.pv, record.op, record.sp, np.zeros(record.samples, dtype=np.bool_)
    )
    loops = [close(fit, law, record.sp) for fit in (base, final)]
    told = [None if loop is None else figures(loop) for loop in loops]
    return ClosedLoop(law, figures(recorded), told[0], told[1])
