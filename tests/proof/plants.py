"""Loops with concealed physics, simulated by other equations than the engine's: states stepped in fine time, one
sample at a time.
"""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from app.engine.valve import choudhury_start, choudhury_step, he_step, kano_start, kano_step

SUBSTEPS = 6
FINE = 15


def softplus(x: float) -> float:
    """log(1 + exp(x)) for any x: what is far inside a rounded limit is not changed by it."""
    return max(x, 0.0) + math.log1p(math.exp(-abs(x)))


@dataclass
class Process:
    """Lags in a row (or an integrator and a lag) behind a dead time, integrated by Heun's rule. Deviations from the
    working point.
    """

    gain: float
    taus: tuple[float, ...]
    dead_time: float
    integrating: bool
    ts: float
    states: list[float] = field(default_factory=list)
    line: deque[float] = field(default_factory=deque)
    high: float = math.inf
    head: float = 0.0
    zero: float = 0.0

    def __post_init__(self) -> None:
        self.states = [0.0] * (len(self.taus) + self.integrating)
        self.line = deque([0.0] * (round(self.dead_time / self.ts * SUBSTEPS) + 1))

    def step(self, v: float, load: float = 0.0) -> float:
        """PV as deviation at the end of a sample in which v and a load (unit of PV) were held."""
        h = self.ts / SUBSTEPS
        rate = 0.0
        for _ in range(SUBSTEPS):
            self.line.append(v)
            drive = self.gain * self.line.popleft() + load
            rate = self.advance(drive, h)
        return self.states[-1] - self.zero * rate

    def advance(self, drive: float, h: float) -> float:
        before = drive
        rate = 0.0
        for k, tau in enumerate(self.taus):
            x = self.states[k]
            if k == 0 and self.head > 0.0:
                leak = self.head * 2.0 * (math.sqrt(max(1.0 + x / self.head, 0.0)) - 1.0)
                rate = (before - leak) / tau
                x += h * rate
            else:
                stay = math.exp(-h / tau)
                rate = (before - x) / tau
                x = stay * x + (1.0 - stay) * before
            self.states[k] = min(x, self.high) if k == 0 and not self.integrating else x
            before = self.states[k]
        if self.integrating:
            self.states[-1] = min(self.states[-1] + h * before, self.high)
        return rate


@dataclass
class ExactLags(Process):
    """Two lags in a row behind a dead time, without a step of integration: what a zero behind them makes of their rate
    is that zero, where `Process` makes one of it that is up to 5 % longer.
    """

    def advance(self, drive: float, h: float) -> float:
        (one, other), (first, second) = self.taus, self.states
        stay, stays = math.exp(-h / one), math.exp(-h / other)
        along = (first - drive) * one / (one - other)
        self.states = [drive + (first - drive) * stay, drive + along * stay + (second - drive - along) * stays]
        return (self.states[0] - self.states[1]) / other


@dataclass
class MovedMass(Process):
    """A mass on a spring (two lags), or a free one (integrating behind a lag), held and slowed by dry friction; in very
    fine time.
    """

    dry: float = 0.0
    speed: float = 0.0

    def advance(self, drive: float, h: float) -> float:
        mass = math.prod(self.taus)
        damping = 1.0 if self.integrating else sum(self.taus)
        fine = h / FINE
        for _ in range(FINE):
            force = drive - (0.0 if self.integrating else self.states[-1])
            side = math.copysign(1.0, self.speed if self.speed != 0.0 else force)
            if self.speed == 0.0 and abs(force) <= self.dry:
                break
            after = self.speed + fine * (force - damping * self.speed - self.dry * side) / mass
            self.speed = 0.0 if self.speed * after < 0.0 else after
            self.states[-1] += fine * self.speed
        return self.speed


class Valve:
    """Passes OP on; the effects of a valve are its subclasses' business. sizes: by the engine's names, as OP."""

    @property
    def sizes(self) -> dict[str, float]:
        return {}

    def step(self, u: float) -> float:
        return u


@dataclass
class StickingValve(Valve):
    """Kano's, Choudhury's or He's stem."""

    model: str
    S: float
    J: float
    state: np.ndarray | None = None

    @property
    def sizes(self) -> dict[str, float]:
        return {"S": self.S, "J": self.J}

    def step(self, u: float) -> float:
        if self.state is None:
            self.state = np.zeros(6 if self.model == "kano" else 5)
            if self.model == "kano":
                kano_start(u, self.state, self.S, self.J)
            elif self.model == "choudhury":
                choudhury_start(u, self.state)
            else:
                self.state[:3] = u, u, 0.0
        move = {"kano": kano_step, "choudhury": choudhury_step, "he": he_step}[self.model]
        return float(move(u, self.state, self.S, self.J))


@dataclass
class FrictionValve(Valve):
    """A stem on a spring with Coulomb and static friction (Karnopp), in fine time: slips without He's exact rule."""

    static: float
    coulomb: float
    x: float | None = None
    moving: bool = False

    def step(self, u: float) -> float:
        if self.x is None:
            self.x = u
        for _ in range(20):
            force = u - self.x
            if not self.moving and abs(force) > self.static:
                self.moving = True
            if self.moving:
                net = abs(force) - self.coulomb
                if net <= 0.02 * self.static:
                    self.moving = False
                else:
                    self.x += math.copysign(0.45 * net, force)
        return self.x


@dataclass
class OtherDownwards(Valve):
    """A stem with a size up and another one down."""

    up: float
    down: float
    x: float | None = None

    @property
    def sizes(self) -> dict[str, float]:
        return {"band": self.up + self.down}


@dataclass
class Backlash(OtherDownwards):
    """A play operator, its two half gaps not quite alike."""

    def step(self, u: float) -> float:
        if self.x is None:
            self.x = u
        self.x = min(max(self.x, u - self.up), u + self.down)
        return self.x


@dataclass
class SlewValve(OtherDownwards):
    """Opens and closes at its own rates (OP a sample)."""

    def step(self, u: float) -> float:
        if self.x is None:
            self.x = u
        self.x += min(max(u - self.x, -self.down), self.up)
        return self.x


@dataclass
class StaticValve(Valve):
    """Any curve from OP to flow."""

    curve: object

    def step(self, u: float) -> float:
        return float(self.curve(u))  # type: ignore[operator]


class Sensor:
    """Shows what is there; what a sensor makes of it is its subclasses' business."""

    def step(self, level: float) -> float:
        """What would be read without noise."""
        return level

    def show(self, reading: float) -> float:
        """What is shown of a reading with its noise."""
        return reading


@dataclass
class Controller:
    """PI or PID (derivative on PV, filtered), clamped, with conditional integration. Unit of OP."""

    kc: float
    ti: float
    td: float
    ts: float
    bias: float
    low: float
    high: float
    integral: float = 0.0
    filtered: float | None = None

    def step(self, sp: float, pv: float) -> float:
        error = sp - pv
        derivative = 0.0
        if self.td > 0.0:
            before = pv if self.filtered is None else self.filtered
            share = self.ts / (self.ts + self.td / 5.0)
            self.filtered = before + share * (pv - before)
            derivative = -self.kc * self.td * (self.filtered - before) / self.ts
        wanted = self.bias + self.kc * error + self.integral + derivative
        if self.low < wanted < self.high or (wanted - self.bias) * self.kc * error < 0.0:
            self.integral += self.kc * error * self.ts / self.ti
        return min(max(wanted, self.low), self.high)
