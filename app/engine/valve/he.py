"""He's two-parameter valve model: the stem sticks again after every slip."""

import numpy as np
from numba import njit

from app.engine.recording import FloatArray
from app.engine.valve.grid import check_bands, check_signal, first_positions


@njit(cache=True, nogil=True)
def he_step(u: float, state: FloatArray, S: float, J: float) -> float:
    """The valve position after OP moved to `u`; `state` (3,) is [u_previous, x, u_r] and is updated in place.

    The accumulated force c = u_r + u(t) - u(t-1) is u(t) - x(t-1), because u_r + x = u at all times: written that way
    no rounding gathers over a long record.
    """
    state[1] = _moved(u, state[1], S, J)
    state[0] = u
    state[2] = u - state[1]
    return state[1]


@njit(cache=True, nogil=True)
def _moved(u: float, x: float, S: float, J: float) -> float:
    """The valve position behind x once OP is at u."""
    c = u - x
    if abs(c) > 0.5 * (S + J):
        return u - 0.5 * (S - J) if c > 0.0 else u + 0.5 * (S - J)
    return x


@njit(cache=True, nogil=True)
def _run_grid(op: FloatArray, S: FloatArray, J: FloatArray, start: FloatArray) -> FloatArray:
    v = np.empty((len(S), len(op)))
    for m in range(len(S)):
        x = start[m]
        for t in range(len(op)):
            x = v[m, t] = _moved(op[t], x, S[m], J[m])
    return v


@njit(cache=True, nogil=True)
def he_stem(op: FloatArray, S: float, J: float, start: float) -> FloatArray:
    """The position (N,) of one valve, as `two_parameter_he` has it of many; nothing is checked."""
    v, x = np.empty(len(op)), start
    for t in range(len(op)):
        x = v[t] = _moved(op[t], x, S, J)
    return v


def two_parameter_he(op: FloatArray, S: FloatArray, J: FloatArray, start: FloatArray | None = None) -> FloatArray:
    """Valve position v, (M, N) in the unit of OP, of He's model for each point (S, J) of a grid.

    op: (N,) finite controller output, any unit. S: (M,) deadband plus stickband; J: (M,) slip jump, 0 <= J; both in the
    unit of OP. f_S = (S + J)/2, f_D = (S - J)/2; the residual force u_r accumulates, c = u_r + u(t) - u(t-1), and where
    abs(c) > f_S the stem slips: v(t) = v(t-1) + c - sign(c) f_D, u_r = sign(c) f_D; otherwise v holds and u_r = c.
    The valve starts at `start` (M,), unit of OP; without it at u(0), without residual force. S = J = 0 passes OP
    through, J = 0 is backlash of width S, S = J = d is the one-parameter model, J > S overshoots.
    Raises DataError("op_not_a_signal") unless OP is one finite row, DataError("stiction_band") for a negative or
    missing band or lengths that differ.

    Misleads: the stem must overcome f_S again after every slip, so an OP that ramps slowly makes a staircase of steps
    J, where Choudhury's and Kano's stem keeps moving.
    Source: He, Wang, Pottmann, Qin 2007, doi 10.1021/ie061219a.
    """
    check_signal(op)
    check_bands(S=S, J=J)
    return _run_grid(
        np.ascontiguousarray(op, dtype=np.float64),
        np.ascontiguousarray(S, dtype=np.float64),
        np.ascontiguousarray(J, dtype=np.float64),
        first_positions(op, S, start),
    )
