"""Whether a measured signal moves PV, or is itself moved by the loop: a read-back of the valve, a second transmitter.

What causes PV helps to predict it from its past, PV's and OP's past known; what the loop moves is predicted by their
past. Source: Granger 1969, doi 10.2307/1912791. The present is left out on both sides: within an interval a cause and
its effect look alike.
"""

from itertools import pairwise

import numpy as np

from app.engine.mismatch.loop.experiment import Experiment
from app.engine.recording import BoolArray, FloatArray

LATEST = 6
_EDGES = (7, 10, 16, 25, 40, 63, 100)
_SAMPLES_A_NUMBER = 10
_FOREWARNS, _SIGNIFICANT = 15.0, 4.0
_HINT_SHARE = 0.4
_OWN_SHARE = 0.15
_FAR, _FEW = 10.0, 3
"""Standard deviations, by the median: so few samples of a signal that jump so far would be foretold by anything."""
_STEM_LEAVES = 0.45
"""Measured: stems that say anything of PV leave OP up to 0.25 of what they say, causes that OP answers 0.6 and more."""


def causes_pv(signal: FloatArray, record: Experiment) -> bool:
    """Whether the past of a signal (N,) says more of PV than PV and OP do, and theirs not much of the signal."""
    pasts = [past(x) for x in (signal, record.pv, record.op)]
    own, loop = pasts[0], np.concatenate(pasts[1:], axis=1)
    kept = known(record)
    if kept.sum() < _SAMPLES_A_NUMBER * (own.shape[1] + loop.shape[1]):
        return True  # too short to tell: the competition asks for its own gain
    forward = _gained(record.pv, loop, own, kept)
    back = _gained(signal, own, loop, _without_jumps(signal, own, kept))
    by_chance = _SIGNIFICANT * np.sqrt(0.5 * loop.shape[1])
    # What comes in a few jumps says little of most samples: more than chance is enough where the loop says less of it.
    # What lags behind PV without its noise says much of PV too: the loop then says more of it than by chance.
    one_way = forward > _SIGNIFICANT * np.sqrt(0.5 * own.shape[1]) and back < min(_HINT_SHARE * forward, by_chance)
    return bool(one_way or (forward > _FOREWARNS and (back < by_chance or back < _OWN_SHARE * forward)))


def _without_jumps(signal: FloatArray, own: FloatArray, kept: BoolArray) -> BoolArray:
    """(N,) the kept samples but a few at which the signal (N,) jumps far from where its own past (N, P) has it: where
    one makes up most of what is to be foretold, the column that happens to stand out there foretells it. More of them
    are how the signal moves, as a stem that sticks.
    """
    away = np.zeros(len(signal))
    away[kept] = np.abs(rest_of(signal[kept], own[kept]))
    jumps = away > _FAR / 0.6745 * np.median(away[kept])
    return kept & ~jumps if jumps.sum() <= _FEW else kept


def stands_for_op(signal: FloatArray, op: FloatArray, pv: FloatArray, kept: BoolArray) -> bool:
    """Whether OP (N,) says little of PV that the signal does not, beside what the signal says that OP does not: so it
    is of a stem behind OP, and not of what OP answers, as feedforward does. kept: (N,) True where PV is looked at.
    """
    late = kept & (np.arange(len(kept)) >= LATEST)
    pasts = [past(x) for x in (signal, op, pv)]
    by_signal = _gained(pv, np.concatenate(pasts[1:], axis=1), pasts[0], late)
    by_op = _gained(pv, np.concatenate((pasts[0], pasts[2]), axis=1), pasts[1], late)
    return by_op < _STEM_LEAVES * by_signal


def past(x: FloatArray) -> FloatArray:
    """(N, P) the last samples before each one, and means over stretches further back, wider and wider."""
    late = np.concatenate((np.full(_EDGES[-1], x[0]), x))
    sums = np.concatenate(([0.0], np.cumsum(late - x[0])))
    at = np.arange(len(x)) + _EDGES[-1]
    columns = [late[at - k] - x[0] for k in range(1, LATEST + 1)]
    columns += [(sums[at - a + 1] - sums[at - b + 1]) / (b - a) for a, b in pairwise(_EDGES)]
    return np.stack(columns, axis=1)


def known(record: Experiment) -> BoolArray:
    """(N,) True where PV is compared, and was over the last samples before."""
    kept = record.usable.copy()
    for k in range(1, LATEST + 1):
        kept[k:] &= record.usable[:-k]
    kept[:LATEST] = False
    return kept


def _gained(y: FloatArray, without: FloatArray, more: FloatArray, kept: BoolArray) -> float:
    """Log-likelihood (nat) by which further columns (N, P) predict y (N,) better, less what they would gain by
    chance.
    """
    every = np.concatenate((without, more), axis=1)
    ratio = _left(y[kept], without[kept]) / _left(y[kept], every[kept])
    return 0.5 * float(kept.sum()) * float(np.log(ratio)) - 0.5 * more.shape[1]


def _left(y: FloatArray, columns: FloatArray) -> float:
    """Sum of squares that the columns (N, P) and a constant leave of y (N,); never zero."""
    rest = rest_of(y, columns)
    return float(rest @ rest) + 1e-12 * float(np.var(y)) * len(y) + 1e-300


def rest_of(y: FloatArray, columns: FloatArray) -> FloatArray:
    """(N,) what the columns (N, P) and a constant leave of y (N,) by least squares."""
    basis = np.column_stack((np.ones(len(y)), columns))
    rest: FloatArray = y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]
    return rest
