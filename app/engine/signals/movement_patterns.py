"""Yamashita's movement patterns: what OP and PV do step by step, rise, fall or stand."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.engine.recording import FloatArray

_MOVES_FROM = 1.0


@njit(cache=True, nogil=True)
def rho_3(op: FloatArray, pv: FloatArray) -> float:
    """rho_3 of OP and PV (n,), for the sign of the process gain that gives more: 0..1.

    Share of the steps in which OP moves and PV stands, of those periods only that end with PV following OP; a step is a
    move from one standard deviation of the steps on. Steps in which both stand do not count.
    Source: Yamashita 2006, Control Engineering Practice 14, 503-510.
    """
    op_moves, pv_moves = _moves(op), _moves(pv)
    counted = np.count_nonzero((op_moves != 0) | (pv_moves != 0))
    if counted == 0:
        return 0.0
    return max(_followed(op_moves, pv_moves), _followed(op_moves, -pv_moves)) / counted


@njit(cache=True, nogil=True)
def _moves(x: FloatArray) -> NDArray[np.int8]:
    """1, 0 or -1 for each step of x: rises, stands, falls."""
    steps = x[1:] - x[:-1]
    steps -= steps.mean()
    least = _MOVES_FROM * (np.sqrt(np.mean(steps * steps)) or 1.0)
    moves = np.zeros(len(steps), dtype=np.int8)
    for i in range(len(steps)):
        if abs(steps[i]) > least:
            moves[i] = 1 if steps[i] > 0.0 else -1
    return moves


@njit(cache=True, nogil=True)
def _followed(op: NDArray[np.int8], pv: NDArray[np.int8]) -> int:
    """Steps in sticking periods (OP moves one way, PV stands) after which PV moves that way and OP not against it."""
    total = length = 0
    way = 0
    for i in range(len(op)):
        if op[i] != 0 and pv[i] == 0 and (length == 0 or op[i] == way):
            way = op[i]
            length += 1
            continue
        if op[i] == 0 and pv[i] == 0:
            continue
        if length > 0 and pv[i] == way and op[i] != -way:
            total += length
        length = 0
        if op[i] != 0 and pv[i] == 0:
            way, length = op[i], 1
    return total
