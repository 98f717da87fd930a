"""Controllers: PI and PID with anti-windup, any linear controller, and manual; all in one discrete form."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from app.engine.recording import FloatArray
from app.engine.simulate.hold import zero_order_hold
from app.errors import DataError

FASTEST_TRACKING_STEPS = 1.0
"""Anti-windup faster than one step would not be stable in discrete time."""
FILTER_N = 10.0
"""Td in time constants of the filter that the derivative is taken from."""


@dataclass(frozen=True)
class Pid:
    """OP = Kc [ (SP - PV) + integral of (SP - PV) / Ti - Td dPV/dt ], Kc in unit of OP per unit of PV.

    Kc: controller gain; negative for a plant with negative gain.
    Ti_s: integral time in s; inf for a P controller.
    Td_s: derivative time in s, on PV, filtered with Td / `FILTER_N`; 0 for PI.
    tracking_s: time in s within which the integral follows a limited OP (anti-windup); None: Ti.
    """

    Kc: float
    Ti_s: float = float("inf")
    Td_s: float = 0.0
    tracking_s: float | None = None


@dataclass(frozen=True)
class LinearController:
    """OP = C(s) (SP - PV), falling powers of s. It has no anti-windup: meant for controllers without integral."""

    numerator: tuple[float, ...]
    denominator: tuple[float, ...]


@dataclass(frozen=True)
class Manual:
    """OP stays where it is; the loop is open and says so in its mode."""


Controller = Pid | LinearController | Manual


class DiscreteController(NamedTuple):
    """u(k) = c z(k) + d_sp sp(k) + d_pv pv(k); z(k+1) = a z + b_sp sp + b_pv pv + tracking (limited u - u).

    A named tuple because compiled code takes one as it is.
    """

    a: FloatArray
    b_sp: FloatArray
    b_pv: FloatArray
    c: FloatArray
    d_sp: float
    d_pv: float
    tracking: FloatArray


def discretise(controller: Controller, step_s: float) -> DiscreteController:
    """The controller as it is executed every step_s (s).

    Raises DataError("controller_improper") where a linear controller's numerator has the higher degree and
    DataError("integral_time") where Ti is not positive.
    """
    if isinstance(controller, Pid):
        return _pid(controller, step_s)
    if isinstance(controller, LinearController):
        return _linear(controller, step_s)
    nothing = np.zeros(1)
    return DiscreteController(np.zeros((1, 1)), nothing, nothing, nothing, 0.0, 0.0, nothing)


def _pid(pid: Pid, step_s: float) -> DiscreteController:
    if pid.Ti_s <= 0:
        raise DataError("integral_time", f"the integral time must be positive (inf for P control), got {pid.Ti_s} s")
    per_step = pid.Kc * step_s / pid.Ti_s
    # States: the integral part in units of OP, and PV filtered by Td/FILTER_N, from which the derivative is taken.
    filter_pole = np.exp(-step_s * FILTER_N / pid.Td_s) if pid.Td_s else 0.0
    derivative = pid.Kc * FILTER_N if pid.Td_s else 0.0
    tracking_s = pid.Ti_s if pid.tracking_s is None else pid.tracking_s
    share = min(1.0 / FASTEST_TRACKING_STEPS, step_s / tracking_s)
    return DiscreteController(
        a=np.diag([1.0, filter_pole]),
        b_sp=np.array([per_step, 0.0]),
        b_pv=np.array([-per_step, 1.0 - filter_pole]),
        c=np.array([1.0, derivative]),
        d_sp=float(pid.Kc),
        d_pv=-pid.Kc - derivative,
        tracking=np.array([share, 0.0]),
    )


def _linear(controller: LinearController, step_s: float) -> DiscreteController:
    if len(controller.numerator) > len(controller.denominator):
        raise DataError("controller_improper", f"{controller} must not have more zeros than poles")
    a, b, c, d = scipy.signal.tf2ss(controller.numerator, controller.denominator)
    phi, gamma = zero_order_hold(a, b, step_s)
    return DiscreteController(
        a=phi,
        b_sp=gamma,
        b_pv=-gamma,
        c=np.ascontiguousarray(c[0]),
        d_sp=float(d[0, 0]),
        d_pv=-float(d[0, 0]),
        tracking=np.zeros(len(a)),
    )
