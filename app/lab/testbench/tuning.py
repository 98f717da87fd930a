"""Controllers by how near they bring the loop to the limit of stability."""

import math

import numpy as np

from app.engine.simulate import Pid, Plant
from app.lab.testbench.case import ControllerKind


def tuned(plant: Plant, kind: ControllerKind, slowest_s: float, tightness: float) -> Pid:
    """The controller at `tightness` times the gain at which the loop would oscillate on its own.

    slowest_s: the plant's largest lag and dead time together, in s; the integral time follows from it.
    """
    integral = (6.0 if plant.integrating else 0.8) * slowest_s
    Ti_s = math.inf if kind == "P" else integral
    Td_s = 0.15 * slowest_s if kind == "PID" else 0.0
    return Pid(Kc=tightness * _ultimate_gain(plant, Ti_s, Td_s, slowest_s), Ti_s=Ti_s, Td_s=Td_s)


def _ultimate_gain(plant: Plant, Ti_s: float, Td_s: float, slowest_s: float) -> float:
    """The gain at which the open loop passes -1: 1 / abs(L) where its phase falls through -180 degrees."""
    jw = 1j * np.geomspace(1e-3, 1e3, 6000) / slowest_s
    delay = np.exp(-jw * plant.dead_time_s)
    process = np.polyval(plant.numerator, jw) / np.polyval(plant.denominator, jw) * delay
    law = 1.0 + (0.0 if math.isinf(Ti_s) else 1.0 / (jw * Ti_s)) + jw * Td_s / (1.0 + jw * Td_s / 10.0)
    phase = np.unwrap(np.angle(process * law))
    # Phases are known up to whole turns; the first frequency lies between 0 and -180 degrees.
    phase -= 2.0 * np.pi * np.ceil((phase[0] - 1e-9) / (2.0 * np.pi))
    through = np.flatnonzero((phase[:-1] > -np.pi) & (phase[1:] <= -np.pi))
    first = int(through[0]) if len(through) else len(jw) - 1
    return float(1.0 / abs(process[first] * law[first]))
