"""Choudhury's two-parameter valve model: the stem sticks where OP stops or turns, and moves on until then."""

import numpy as np
from numba import njit

from app.engine.recording import FloatArray
from app.engine.valve.grid import check_bands, check_signal, first_positions


@njit(cache=True, nogil=True)
def choudhury_start(u: float, state: FloatArray) -> None:
    """Sets `state` (5,) = [u_previous, x, direction of OP's last step, u_s, stuck] to a stem at rest at `u`."""
    state[0] = u
    state[1] = u
    state[2] = 0.0
    state[3] = u
    state[4] = 1.0


@njit(cache=True, nogil=True)
def choudhury_step(u: float, state: FloatArray, S: float, J: float) -> float:
    """The valve position after OP moved to `u`; `state` (5,) as `choudhury_start` sets it, updated in place."""
    x = state[1]
    direction = np.sign(u - state[0])
    if direction != state[2] and state[4] == 0.0:
        state[3] = state[0]
        state[4] = 1.0
    if state[4] == 0.0:
        x = u - 0.5 * direction * (S - J)
    elif direction != 0.0 and _overcomes(u, x, state[3], S, J):
        x = u - 0.5 * direction * (S - J)
        state[4] = 0.0
    state[0] = u
    state[1] = x
    state[2] = direction
    return x


@njit(cache=True, nogil=True)
def _overcomes(u: float, x: float, u_s: float, S: float, J: float) -> bool:
    """Whether OP frees a stem stuck since OP was u_s: J further on in the old direction, S after a turn.

    The stem lags OP, so it stands on the far side of u_s from where it was going (S > J). With S = J, with overshoot
    (J > S) and at the start its side says nothing; the distance of OP from the stem does in every case.
    """
    if S > J and (u - u_s) * (u_s - x) > 0.0:
        return abs(u - u_s) > J
    return abs(u - x) > 0.5 * (S + J)


@njit(cache=True, nogil=True)
def _run_grid(op: FloatArray, S: FloatArray, J: FloatArray, start: FloatArray) -> FloatArray:
    v = np.empty((len(S), len(op)))
    state = np.empty(5)
    for m in range(len(S)):
        choudhury_start(op[0], state)
        state[1] = state[3] = start[m]
        for t in range(len(op)):
            v[m, t] = choudhury_step(op[t], state, S[m], J[m])
    return v


@njit(cache=True, nogil=True)
def choudhury_stem(op: FloatArray, S: float, J: float, start: float) -> FloatArray:
    """The position (N,) of one valve, as `two_parameter_choudhury` has it of many; nothing is checked."""
    v, state = np.empty(len(op)), np.empty(5)
    choudhury_start(op[0], state)
    state[1] = state[3] = start
    for t in range(len(op)):
        v[t] = choudhury_step(op[t], state, S, J)
    return v


def two_parameter_choudhury(
    op: FloatArray, S: FloatArray, J: FloatArray, start: FloatArray | None = None
) -> FloatArray:
    """Valve position v, (M, N) in the unit of OP, of Choudhury's model for each point (S, J) of a grid.

    op: (N,) finite controller output, any unit; not limited to a span here. S: (M,) deadband plus stickband;
    J: (M,) slip jump, 0 <= J; both in the unit of OP. The stem sticks where OP stops or changes its direction; it moves
    again when OP has gone J further in the old direction or S in the new one, and while it moves
    v = u - sign(du) (S - J)/2. A turn that is met while the stem is stuck does not set the count back (the later form
    of the algorithm, needed for noisy OP). The valve starts at rest at `start` (M,), in the unit of OP, and
    without it at u(0). S = J = 0 passes OP through, J = 0 is backlash of
    width S. From the same start it is Kano's model in other words: the same positions for 0 <= J <= S.
    Raises DataError("op_not_a_signal") unless OP is one finite row, DataError("stiction_band") for a negative or
    missing band or lengths that differ.

    Misleads: noise on OP is a turn at nearly every sample, and each turn is taken for the stem's.
    Source: Choudhury, Thornhill, Shah 2005, doi 10.1016/j.conengprac.2004.05.005; compared with its rivals in
    Garcia 2008, doi 10.1016/j.conengprac.2008.01.010.
    """
    check_signal(op)
    check_bands(S=S, J=J)
    return _run_grid(
        np.ascontiguousarray(op, dtype=np.float64),
        np.ascontiguousarray(S, dtype=np.float64),
        np.ascontiguousarray(J, dtype=np.float64),
        first_positions(op, S, start),
    )
