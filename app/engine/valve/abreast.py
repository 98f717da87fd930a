"""Many valves of one form moved by the same OP, all abreast: one after another would wait at every sample."""

import numpy as np
from numba import njit

from app.engine.recording import FloatArray

SAMPLES_ABREAST = 64


@njit(cache=True, nogil=True)
def he_stems_by_sample(op: FloatArray, S: FloatArray, J: FloatArray, x: FloatArray, v: FloatArray) -> None:
    """v (N, M) of He's valves in the unit of OP, all abreast, from the positions x (M,) on, which go with them."""
    reach, behind = 0.5 * (S + J), 0.5 * (S - J)
    for t in range(len(op)):
        u, moved = op[t], v[t]
        for m in range(len(x)):
            force = u - x[m]
            slipped = u - behind[m] if force > 0.0 else u + behind[m]
            x[m] = slipped if abs(force) > reach[m] else x[m]
            moved[m] = x[m]


@njit(cache=True, nogil=True)
def write_transposed(by_sample: FloatArray, begin: int, rows: FloatArray) -> None:
    """Writes by_sample (n, M) into the rows of rows (M, N), from the sample `begin` on."""
    # Unsigned, because a signed index is checked for its sign at every element.
    first = np.uint64(begin)
    for m in range(np.uint64(rows.shape[0])):
        for t in range(np.uint64(len(by_sample))):
            rows[m, first + t] = by_sample[t, m]


@njit(cache=True, nogil=True)
def he_stems(op: FloatArray, S: FloatArray, J: FloatArray, v: FloatArray) -> FloatArray:
    """v (M, N) of He's valves in the unit of OP, at rest at the first sample, all abreast; returns their means (M,)."""
    x, total = np.full(len(S), op[0]), np.zeros(len(S))
    moved = np.empty((SAMPLES_ABREAST, len(S)))
    for begin in range(0, len(op), SAMPLES_ABREAST):
        part = op[begin : begin + SAMPLES_ABREAST]
        he_stems_by_sample(part, S, J, x, moved)
        for t in range(len(part)):
            for m in range(len(x)):
                total[m] += moved[t, m]
        write_transposed(moved[: len(part)], begin, v)
    return total / len(op)


@njit(cache=True, nogil=True)
def kano_stems(op: FloatArray, S: FloatArray, J: FloatArray, v: FloatArray) -> FloatArray:
    """v (M, N) of Kano's valves in the unit of OP, at rest at the first sample, all abreast; returns their means (M,).

    Sample by sample what `app.engine.valve.kano_step` does.
    """
    x, behind = np.full(len(S), op[0]), 0.5 * (S - J)
    stopped_at, direction, rests = op[0] + behind, np.ones(len(S)), np.ones(len(S))
    moved, total = np.empty((SAMPLES_ABREAST, len(S))), np.zeros(len(S))
    before, step_before = op[0], 0.0
    for begin in range(0, len(op), SAMPLES_ABREAST):
        part = op[begin : begin + SAMPLES_ABREAST]
        for t in range(len(part)):
            u = part[t]
            step = u - before
            halts = 1.0 if step * step_before <= 0.0 else 0.0
            for m in range(len(x)):
                stops = halts * (1.0 - rests[m])
                stopped_at[m] = before if stops == 1.0 else stopped_at[m]
                resting = rests[m] + stops
                since_stop = direction[m] * (u - stopped_at[m])
                turns = resting if -since_stop > S[m] else 0.0
                starts = 1.0 if since_stop > J[m] else turns
                direction[m] = -direction[m] if turns == 1.0 else direction[m]
                rests[m] = resting if starts == 0.0 else 0.0
                x[m] = u - direction[m] * behind[m] if rests[m] == 0.0 else x[m]
                moved[t, m] = x[m]
                total[m] += x[m]
            before, step_before = u, step
        write_transposed(moved[: len(part)], begin, v)
    return total / len(op)
