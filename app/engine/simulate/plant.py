"""Linear plants: continuous transfer functions with dead time and integrators, and their exact discrete form."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from app.engine.recording import FloatArray
from app.engine.simulate.hold import zero_order_hold
from app.errors import DataError


@dataclass(frozen=True)
class Plant:
    """K B(s) / A(s) e^(-theta s) from valve position to PV.

    numerator, denominator: coefficients in falling powers of s (time in s); the numerator's degree is lower.
    dead_time_s: theta in s, not negative.
    Raises DataError("plant_improper") where the numerator's degree is not lower, DataError("dead_time_negative").
    """

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]
    dead_time_s: float = 0.0

    def __post_init__(self) -> None:
        if len(np.trim_zeros(self.numerator, "f")) >= len(np.trim_zeros(self.denominator, "f")):
            raise DataError("plant_improper", f"{self.numerator} / {self.denominator} must be strictly proper")
        if self.dead_time_s < 0:
            raise DataError("dead_time_negative", f"a dead time cannot be negative, got {self.dead_time_s} s")

    @property
    def integrating(self) -> bool:
        """Whether the plant has a pole at zero."""
        return self.denominator[-1] == 0.0

    @property
    def gain(self) -> float:
        """K: the steady-state gain, or the slope per unit of input for a plant with one integrator."""
        if self.integrating:
            return self.numerator[-1] / self.denominator[-2]
        return self.numerator[-1] / self.denominator[-1]


def first_order(K: float, tau_s: float, theta_s: float = 0.0) -> Plant:
    """K e^(-theta s) / (tau s + 1). tau_s, theta_s in s."""
    return Plant((K,), (tau_s, 1.0), theta_s)


def second_order(K: float, tau_s: float, zeta: float, theta_s: float = 0.0) -> Plant:
    """K e^(-theta s) / (tau^2 s^2 + 2 zeta tau s + 1); zeta above 1 is overdamped. tau_s, theta_s in s."""
    return Plant((K,), (tau_s**2, 2.0 * zeta * tau_s, 1.0), theta_s)


def integrator(K: float, theta_s: float = 0.0, tau_s: float = 0.0) -> Plant:
    """K e^(-theta s) / (s (tau s + 1)): PV moves by K per second and unit of input. theta_s, tau_s in s."""
    return Plant((K,), (tau_s, 1.0, 0.0) if tau_s else (1.0, 0.0), theta_s)


class DiscretePlant(NamedTuple):
    """x(k+1) = phi x(k) + gamma_now v(k-m) + gamma_before v(k-m-1), y(k) = c x(k); m = delay_steps.

    A named tuple because compiled code takes one as it is.
    """

    phi: FloatArray
    gamma_now: FloatArray
    gamma_before: FloatArray
    c: FloatArray
    delay_steps: int


def discretise(plant: Plant, step_s: float) -> DiscretePlant:
    """The plant at step_s (s), exact for an input held over each step, dead times between two steps included."""
    a, b, c, _ = scipy.signal.tf2ss(plant.numerator, plant.denominator)
    steps = plant.dead_time_s / step_s
    delay_steps = int(np.floor(steps + 1e-9))
    late_s = max(0.0, plant.dead_time_s - delay_steps * step_s)
    phi_early, gamma_now = zero_order_hold(a, b, step_s - late_s)
    phi_late, gamma_late = zero_order_hold(a, b, late_s)
    return DiscretePlant(
        phi=phi_early @ phi_late,
        gamma_now=gamma_now,
        gamma_before=phi_early @ gamma_late,
        c=np.ascontiguousarray(c[0]),
        delay_steps=delay_steps,
    )
