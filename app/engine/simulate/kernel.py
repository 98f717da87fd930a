"""One pass around the loop per step, compiled: measure, control, move the valve, move the plant."""

import math

import numpy as np
from numba import njit

from app.engine.recording import FloatArray
from app.engine.simulate.actuator import move


@njit(cache=True, fastmath=False, nogil=True)
def limited(value: float, low: float, high: float, resolution: float) -> float:
    """value rounded to a multiple of resolution (0 for none) and kept between low and high."""
    if resolution > 0.0:
        value = math.floor(value / resolution + 0.5) * resolution
    return min(max(value, low), high)


@njit(cache=True, fastmath=False, nogil=True)
def run(
    driven: FloatArray,
    every: int,
    first: int,
    plant_phi: FloatArray,
    plant_gamma_now: FloatArray,
    plant_gamma_before: FloatArray,
    plant_c: FloatArray,
    delay_steps: int,
    control_a: FloatArray,
    control_b_sp: FloatArray,
    control_b_pv: FloatArray,
    control_c: FloatArray,
    control_d_sp: float,
    control_d_pv: float,
    control_tracking: FloatArray,
    valve_kind: int,
    valve_state: FloatArray,
    valve_parameters: FloatArray,
    pv_start: float,
    op_start: float,
    pv_limits: FloatArray,
    op_limits: FloatArray,
    frozen_from: int,
) -> FloatArray:
    """(4, R) rows PV, OP, valve position, true output: every `every`-th step from `first` on.

    driven: (4, N) rows set point, load (at the valve), upset (at the output), measurement noise.
    pv_limits, op_limits: (3,) low, high, resolution. frozen_from: the step from which the transmitter holds its value.
    """
    steps = driven.shape[1]
    out = np.empty((4, (steps - first + every - 1) // every))
    x = np.zeros(plant_c.size)
    x_next = np.zeros(plant_c.size)
    z = np.zeros(control_c.size)
    z_next = np.zeros(control_c.size)
    line = np.zeros(delay_steps + 2)
    pv = pv_start
    row = 0
    for k in range(steps):
        true = pv_start + driven[2, k]
        for i in range(x.size):
            true += plant_c[i] * x[i]
        if k < frozen_from:
            pv = limited(true + driven[3, k], pv_limits[0], pv_limits[1], pv_limits[2])

        sp_deviation, pv_deviation = driven[0, k] - pv_start, pv - pv_start
        wanted = op_start + control_d_sp * sp_deviation + control_d_pv * pv_deviation
        for i in range(z.size):
            wanted += control_c[i] * z[i]
        op = limited(wanted, op_limits[0], op_limits[1], op_limits[2])
        kept = min(max(wanted, op_limits[0]), op_limits[1])
        for i in range(z.size):
            z_next[i] = control_b_sp[i] * sp_deviation + control_b_pv[i] * pv_deviation
            z_next[i] += control_tracking[i] * (kept - wanted)
            for j in range(z.size):
                z_next[i] += control_a[i, j] * z[j]
        z, z_next = z_next, z

        v = move(valve_kind, op, valve_state, valve_parameters)
        line[k % line.size] = v - op_start + driven[1, k]
        now = line[(k - delay_steps) % line.size]
        before = line[(k - delay_steps - 1) % line.size]
        for i in range(x.size):
            x_next[i] = plant_gamma_now[i] * now + plant_gamma_before[i] * before
            for j in range(x.size):
                x_next[i] += plant_phi[i, j] * x[j]
        x, x_next = x_next, x

        if k >= first and (k - first) % every == 0:
            out[0, row], out[1, row], out[2, row], out[3, row] = pv, op, v, true
            row += 1
    return out
