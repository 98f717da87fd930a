"""Where an episode begins and ends: the sample at which the movement of the loop changes most."""

import numpy as np

from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import without_line

_FEWEST_PIECES = 3
_LEAST_CHANGE = 1.5
_LEAST_PIECE = 12


def refined(record: UniformRecord, edge: int, half: int, per_cycle: float, rises: bool) -> int:
    """The sample near `edge` at which a spell begins (`rises`) or ends.

    edge: the outer end of the first or last sticky window; half: half the length of a window, in samples. A window is
    sticky from about the half of it on, so the change lies within a window of its outer end. In pieces of one cycle the
    size of PV's and OP's movement and of their steps is taken (log variance); the change is where two means fit them
    best. Where they hardly change, a quarter of a window inside the edge is answered.
    """
    size = int(max(per_cycle, _LEAST_PIECE))
    low, high = (edge - half, edge + 2 * half) if rises else (edge - 2 * half, edge + half)
    low, high = max(low, 0), min(high, record.samples)
    count = (high - low) // size
    coarse = edge + (half // 2 if rises else -(half // 2))
    if count < 2 * _FEWEST_PIECES:
        return int(np.clip(coarse, 0, record.samples - 1))
    table = np.array([_movement(record, low + k * size, size) for k in range(count)])
    where = _change(table)
    return low + where * size if where is not None else int(np.clip(coarse, 0, record.samples - 1))


def _movement(record: UniformRecord, start: int, size: int) -> FloatArray:
    """(4,) log variance of PV and OP less a straight line, and of their steps."""
    pv, op = record.pv[start : start + size], record.op[start : start + size]
    sizes = np.array([np.var(without_line(pv)), np.var(without_line(op)), np.var(np.diff(pv)), np.var(np.diff(op))])
    whole = np.array([np.var(record.pv), np.var(record.op)] * 2)
    return np.log(sizes / (whole + 1e-300) + 1e-6)


def _change(table: FloatArray) -> int | None:
    """The row of table (n, k) before which two means fit it best, or None where they differ too little."""
    n = len(table)
    spread = 0.25 + np.median(np.abs(np.diff(table, axis=0)), axis=0)
    scaled = table / spread
    best, where = 0.0, None
    for k in range(_FEWEST_PIECES, n - _FEWEST_PIECES + 1):
        gap = scaled[k:].mean(axis=0) - scaled[:k].mean(axis=0)
        score = float(gap @ gap) * k * (n - k) / n
        if score > best and float(np.max(np.abs(gap))) > _LEAST_CHANGE:
            best, where = score, k
    return where
