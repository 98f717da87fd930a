"""Kano's two-parameter valve model: elastic, air and friction force in balance, the friction's direction kept."""

import numpy as np
from numba import njit

from app.engine.recording import FloatArray
from app.engine.valve.grid import check_bands, check_signal


@njit(cache=True, nogil=True)
def kano_start(u: float, state: FloatArray, S: float, J: float) -> None:
    """Sets `state` (6,) = [u_previous, x, previous step of OP, u_s, stp, d] to a stem at rest at `u`.

    The direction d of the friction force is not known before the first movement; u_s is set so that both directions
    ask for the same (S + J)/2.
    """
    state[0] = u
    state[1] = u
    state[2] = 0.0
    state[3] = u + 0.5 * (S - J)
    state[4] = 1.0
    state[5] = 1.0


@njit(cache=True, nogil=True)
def kano_step(u: float, state: FloatArray, S: float, J: float) -> float:
    """The valve position after OP moved to `u`; `state` (6,) as `kano_start` sets it, updated in place."""
    step = u - state[0]
    if state[4] == 0.0 and step * state[2] <= 0.0:
        state[3] = state[0]
        state[4] = 1.0
    since_stop = state[5] * (u - state[3])
    if state[4] == 1.0 and -since_stop > S:
        state[5] = -state[5]
        state[4] = 0.0
    elif since_stop > J:
        state[4] = 0.0
    if state[4] == 0.0:
        state[1] = u - 0.5 * state[5] * (S - J)
    state[0] = u
    state[2] = step
    return state[1]


@njit(cache=True, nogil=True)
def _run_grid(op: FloatArray, S: FloatArray, J: FloatArray) -> FloatArray:
    v = np.empty((len(S), len(op)))
    state = np.empty(6)
    for m in range(len(S)):
        kano_start(op[0], state, S[m], J[m])
        for t in range(len(op)):
            v[m, t] = kano_step(op[t], state, S[m], J[m])
    return v


def two_parameter_kano(op: FloatArray, S: FloatArray, J: FloatArray) -> FloatArray:
    """Valve position v, (M, N) in the unit of OP, of Kano's model for each point (S, J) of a grid.

    op: (N,) finite controller output, any unit. S: (M,) deadband plus stickband; J: (M,) slip jump, 0 <= J; both in the
    unit of OP. Where OP stops or turns while the stem moves, u_s = u(t-1) and the stem rests (stp = 1); it moves again
    where -d (u - u_s) > S, which turns the friction force d, or d (u - u_s) > J; moving, v = u - d (S - J)/2.
    The valve starts at u(0). S = J = 0 passes OP through, J = 0 is backlash of width S.
    Raises DataError("op_not_a_signal") unless OP is one finite row, DataError("stiction_band") for a negative or
    missing band or lengths that differ.

    Source: Kano, Maruta, Kugemoto, Shimizu 2004, Practical model and detection algorithm for valve stiction,
    IFAC Proceedings Volumes 37 (9), 859-864.
    """
    check_signal(op)
    check_bands(S=S, J=J)
    return _run_grid(
        np.ascontiguousarray(op, dtype=np.float64),
        np.ascontiguousarray(S, dtype=np.float64),
        np.ascontiguousarray(J, dtype=np.float64),
    )
