"""One pass around the loop per step, compiled: measure, control, move the valve, move the plant.

The parts are inlined: a call counts the references to each array it is handed, which took two fifths of a step.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from app.engine.recording import FloatArray
from app.engine.simulate.actuator import CompiledValve, move
from app.engine.simulate.controller import DiscreteController
from app.engine.simulate.plant import DiscretePlant


class Instrument(NamedTuple):
    """Limits and resolution (0 for none) of the transmitter or of OP, and where it rests."""

    low: float
    high: float
    resolution: float
    rest: float


@njit(cache=True, fastmath=False, nogil=True, inline="always")
def limited(value: float, instrument: Instrument) -> float:
    """value rounded to a multiple of the resolution and kept within the limits."""
    if instrument.resolution > 0.0:
        value = math.floor(value / instrument.resolution + 0.5) * instrument.resolution
    return min(max(value, instrument.low), instrument.high)


@njit(cache=True, fastmath=False, nogil=True, inline="always")
def control(sp: float, pv: float, z: FloatArray, room: FloatArray, law: DiscreteController, out: Instrument) -> float:
    """OP wanted for deviations sp, pv; z is updated in place, following OP where its limits hold it back."""
    wanted = out.rest + law.d_sp * sp + law.d_pv * pv
    for i in range(z.size):
        wanted += law.c[i] * z[i]
    excess = min(max(wanted, out.low), out.high) - wanted
    for i in range(z.size):
        total = law.b_sp[i] * sp + law.b_pv[i] * pv + law.tracking[i] * excess
        for j in range(z.size):
            total += law.a[i, j] * z[j]
        room[i] = total
    for i in range(z.size):
        z[i] = room[i]
    return wanted


@njit(cache=True, fastmath=False, nogil=True, inline="always")
def advance(x: FloatArray, room: FloatArray, plant: DiscretePlant, now: float, before: float) -> None:
    """Moves the plant's state x by one step, in place."""
    for i in range(x.size):
        total = plant.gamma_now[i] * now + plant.gamma_before[i] * before
        for j in range(x.size):
            total += plant.phi[i, j] * x[j]
        room[i] = total
    for i in range(x.size):
        x[i] = room[i]


@njit(cache=True, fastmath=False, nogil=True)
def run(
    driven: FloatArray,
    every: int,
    first: int,
    plant: DiscretePlant,
    law: DiscreteController,
    valve: CompiledValve,
    transmitter: Instrument,
    output: Instrument,
    frozen_from: int,
) -> FloatArray:
    """(4, R) rows PV, OP, valve position, true output: every `every`-th step from `first` on.

    driven: (4, N) rows set point, load (at the valve), upset (at the output), measurement noise. frozen_from: the step
    from which the transmitter holds its value.
    """
    steps = driven.shape[1]
    recorded = np.empty((4, (steps - first + every - 1) // every))
    x, x_room = np.zeros(plant.c.size), np.zeros(plant.c.size)
    z, z_room = np.zeros(law.c.size), np.zeros(law.c.size)
    line = np.zeros(plant.delay_steps + 2)
    kind, state, parameters = valve
    pv = transmitter.rest
    # Counted on instead of divided: each remainder took as long as moving the plant.
    newest, row, until_recorded = 0, 0, first
    for k in range(steps):
        true = transmitter.rest + driven[2, k]
        for i in range(x.size):
            true += plant.c[i] * x[i]
        if k < frozen_from:
            pv = limited(true + driven[3, k], transmitter)
        op = limited(control(driven[0, k] - transmitter.rest, pv - transmitter.rest, z, z_room, law, output), output)
        v = move(kind, state, parameters, op)
        line[newest] = v - output.rest + driven[1, k]
        newest = newest + 1 if newest + 1 < line.size else 0  # from now on the oldest, of a delay and one step before
        advance(x, x_room, plant, line[newest + 1 if newest + 1 < line.size else 0], line[newest])
        if until_recorded == 0:
            recorded[0, row], recorded[1, row], recorded[2, row], recorded[3, row] = pv, op, v, true
            row, until_recorded = row + 1, every
        until_recorded -= 1
    return recorded
