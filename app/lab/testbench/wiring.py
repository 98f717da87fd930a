"""What a loop of any wiring is put together from, one scan at a time: controller, process, load, valve."""

import math
from dataclasses import dataclass, field

import numpy as np

from app.engine.simulate.actuator import LinearValve, TwoParameterValve, compiled, move


class Valve:
    """A stem at rest at start, per cent. S, J: stiction, per cent of OP's span; S = 0: it follows OP."""

    def __init__(self, start: float, S: float = 0.0, J: float = 0.0) -> None:
        self._compiled = compiled(TwoParameterValve(S, J) if S else LinearValve(), start, 1.0)

    def to(self, op: float) -> float:
        """Position, per cent, after OP moved to op."""
        kind, state, parameters = self._compiled
        return float(move(kind, state, parameters, op))


@dataclass
class Pi:
    """u = start + Kc (e + integral of e / Ti) within limits, the integral following u where a limit holds it.

    Kc: unit of OP over unit of PV. Ti_s: s; infinite: none.
    """

    Kc: float
    Ti_s: float
    start: float
    limits: tuple[float, float] = (0.0, 100.0)
    _bias: float = field(init=False)

    def __post_init__(self) -> None:
        self._bias = self.start

    def output(self, error: float, step_s: float, gain: float = 1.0) -> float:
        """OP for a control error; gain multiplies Kc, for a controller that is not linear."""
        self._bias += self.Kc * gain * error * step_s / self.Ti_s
        wanted = self._bias + self.Kc * gain * error
        op = min(max(wanted, self.limits[0]), self.limits[1])
        if math.isfinite(self.Ti_s):
            self._bias += op - wanted
        return op

    def follow(self, op: float, error: float) -> None:
        """Another controller moves the valve: the integral is set so that this one would ask for op."""
        self._bias = op - self.Kc * error


@dataclass
class Lag:
    """First order with a dead time of whole scans, at rest at zero. K: unit of PV over unit of OP; tau_s: s."""

    K: float
    tau_s: float
    delay: int = 1
    _state: float = 0.0
    _line: list[float] = field(default_factory=list)

    def after(self, u: float, step_s: float) -> float:
        """PV's deviation one scan later, with u held."""
        self._line.append(u)
        late = self._line.pop(0) if len(self._line) > self.delay else 0.0
        self._state += (1.0 - math.exp(-step_s / self.tau_s)) * (self.K * late - self._state)
        return self._state


@dataclass
class Level:
    """A vessel that integrates what comes in. hold_s: until it has risen by what is put in."""

    hold_s: float
    _state: float = 0.0

    def after(self, u: float, step_s: float) -> float:
        """PV's deviation one scan later, with u held."""
        self._state += u * step_s / self.hold_s
        return self._state


class Wandering:
    """A load that wanders about zero. sd: its standard deviation; tau_s: correlation time, s."""

    def __init__(self, rng: np.random.Generator, sd: float, tau_s: float) -> None:
        self._rng, self._sd, self._tau_s = rng, sd, tau_s
        self._now = sd * float(rng.standard_normal())

    def after(self, step_s: float) -> float:
        kept = math.exp(-step_s / self._tau_s)
        self._now = kept * self._now + math.sqrt(1.0 - kept**2) * self._sd * float(self._rng.standard_normal())
        return self._now
