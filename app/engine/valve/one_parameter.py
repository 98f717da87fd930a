"""The one-parameter valve model: the stem holds until OP is more than d away, then takes OP's value (eq 1)."""

import numpy as np
from numba import njit

from app.engine.recording import FloatArray
from app.engine.valve.grid import check_bands, check_signal


@njit(cache=True, nogil=True)
def one_parameter_step(u: float, state: FloatArray, d: float) -> float:
    """The valve position after OP moved to `u`; `state` (3,) is [u_previous, x, u_r] and is updated in place."""
    if abs(u - state[1]) > d:
        state[1] = u
    state[0] = u
    state[2] = u - state[1]
    return state[1]


@njit(cache=True, nogil=True)
def _run_grid(op: FloatArray, d: FloatArray) -> FloatArray:
    v = np.empty((len(d), len(op)))
    state = np.empty(3)
    for m in range(len(d)):
        state[:] = op[0], op[0], 0.0
        for t in range(len(op)):
            v[m, t] = one_parameter_step(op[t], state, d[m])
    return v


def one_parameter(op: FloatArray, d: FloatArray) -> FloatArray:
    """Valve position v, (M, N) in the unit of OP, of the one-parameter model for each d of a grid (eq 1).

    op: (N,) finite controller output, any unit. d: (M,) stiction bands, not negative, in the unit of OP.
    v(t) = v(t-1) where abs(u(t) - v(t-1)) <= d, otherwise u(t); the valve starts at u(0). d = 0 passes OP through.
    Raises DataError("op_not_a_signal") unless OP is one finite row, DataError("stiction_band") for a negative or
    missing band.

    Misleads: it has no deadband, so a valve with much deadband and little slip jump (backlash) is outside it.
    Source: Stenman, Gustafsson, Forsman 2003, doi 10.1002/acs.784; eq 1 of Srinivasan, Spinner, Rengaswamy 2015,
    doi 10.1021/acs.iecr.5b00939.
    """
    check_signal(op)
    check_bands(d=d)
    return _run_grid(np.ascontiguousarray(op, dtype=np.float64), np.ascontiguousarray(d, dtype=np.float64))
