"""The physical valve: stem mass, spring, air pressure and friction with a Stribeck fall, sticking and slipping."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from app.engine.recording import FloatArray

SUBSTEPS_PER_TIME_CONSTANT = 25
"""Backward Euler is stable at any step; this many steps in the stem's slow time constant keep its error below 2 %."""

LARGEST_ROOT_ITERATIONS = 50
FAST, LEAST_EXCESS = 8.0, 1e-9
"""Of v_s, and of F_s - F_c: beyond both, exp(-(v/v_s)^2) is too small for the search of a root to begin."""


@dataclass(frozen=True)
class PhysicalValve:
    """A pneumatic sliding-stem valve: m x'' = S_a p - k x - F, positions and OP in per cent of travel.

    m: mass of the moving parts, kg. k: spring constant, N/m. S_a: diaphragm area, m2. F_c: Coulomb friction, N.
    F_s: static friction, N, at least F_c. F_v: viscous friction, N s/m. v_s: Stribeck velocity, m/s. pressure_span: air
    pressure between OP = 0 % and 100 %, Pa; travel = S_a pressure_span / k, so that a frictionless valve rests at OP.
    """

    m: float
    k: float
    S_a: float
    F_c: float
    F_s: float
    F_v: float
    v_s: float
    pressure_span: float

    @property
    def travel_m(self) -> float:
        return self.S_a * self.pressure_span / self.k

    @property
    def S_pct(self) -> float:
        """Deadband plus stickband in per cent of travel: (F_s + F_c)/k, by f_S = F_s/k and f_D = F_c/k."""
        return 100.0 * (self.F_s + self.F_c) / (self.k * self.travel_m)

    @property
    def J_pct(self) -> float:
        """Slip jump in per cent of travel: (F_s - F_c)/k."""
        return 100.0 * (self.F_s - self.F_c) / (self.k * self.travel_m)

    @property
    def time_constant_s(self) -> float:
        """The slower time constant of the moving stem, s."""
        poles = np.roots([self.m, self.F_v, self.k])
        return float(1.0 / np.min(-poles.real))

    def parameters(self) -> FloatArray:
        """(7,) for `physical_step`: m, k, F_v, then F_c, F_s, v_s in per cent of travel, and the substep in s."""
        pct = 100.0 / self.travel_m
        substep = self.time_constant_s / SUBSTEPS_PER_TIME_CONSTANT
        return np.array([self.m, self.k, self.F_v, self.F_c * pct, self.F_s * pct, self.v_s * pct, substep])


CLASSIC = PhysicalValve(
    m=1.36, k=52500.0, S_a=0.0645, F_c=1423.0, F_s=1708.0, F_v=613.0, v_s=2.5e-4, pressure_span=82737.0
)
"""The set of Choudhury, Thornhill, Shah 2005 (doi 10.1016/j.conengprac.2004.05.005); 12 psi give its travel of 4 in."""

PACKED = PhysicalValve(
    m=1.6, k=210490.0, S_a=0.0445, F_c=700.0, F_s=780.0, F_v=125000.0, v_s=5e-4, pressure_span=138632.0
)
"""A packed industrial valve: S near 24 % and J near 1 % of a travel of 29 mm, nearly pure deadband."""


@njit(cache=True, nogil=True)
def physical_step(u: float, state: FloatArray, parameters: FloatArray, sampling_interval: float) -> float:
    """The stem position a sampling interval (s) after OP moved to `u` and stayed there.

    u and the result in per cent of travel; `state` (2,) is [position, velocity in per cent of travel a second] and is
    updated in place; parameters: (7,) of `PhysicalValve.parameters`. No end stops: the equations are in deviations.

    Source: the force balance in Choudhury, Thornhill, Shah 2005, doi 10.1016/j.conengprac.2004.05.005; sticking as in
    Karnopp 1985, doi 10.1115/1.3140698.
    """
    m, k, F_v = parameters[0], parameters[1], parameters[2]
    F_c, F_s, v_s = parameters[3], parameters[4], parameters[5]
    count = int(np.ceil(sampling_interval / parameters[6]))
    h = sampling_interval / count
    a = m / h + k * h + F_v
    position, velocity = state[0], state[1]
    for _ in range(count):
        velocity = _velocity_after(m * velocity / h + k * (u - position), velocity, a, F_c, F_s, v_s)
        if velocity == 0.0:
            break
        position += h * velocity
    state[0], state[1] = position, velocity
    return position


@njit(cache=True, nogil=True)
def _velocity_after(r: float, before: float, a: float, F_c: float, F_s: float, v_s: float) -> float:
    """Backward Euler in velocity and position: solves a v + F(v) = r, with the stem stuck where no moving root is.

    F(v) = sign(v) (F_c + (F_s - F_c) exp(-(v/v_s)^2)) falls with speed, so there may be several roots. A stem at rest
    moves only when r exceeds F_s; from above, v <- (r - F(v))/a falls monotonically to the largest root, which is the
    one after the slip. before: the velocity a step ago.
    """
    side = 1.0 if r > 0.0 else -1.0
    r = abs(r)
    at_rest = before * side <= 0.0
    if r <= F_c or (at_rest and r <= F_s):
        return 0.0
    v = (r - F_c) / a
    if v > FAST * v_s and r - F_c > LEAST_EXCESS * (F_s - F_c):
        return side * v
    for _ in range(LARGEST_ROOT_ITERATIONS):
        following = (r - F_c - (F_s - F_c) * np.exp(-((v / v_s) ** 2))) / a
        if following <= 0.0:
            return 0.0
        if v - following <= 1e-9 * v:
            break
        v = following
    return side * v
