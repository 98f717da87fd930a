"""Physics that the library does not have, as parts of a loop: processes, sensors and valves, one sample at a time."""

import math
from collections import deque
from dataclasses import dataclass, field

from tests.proof.plants import SUBSTEPS, Process, Sensor, Valve

MOST_EXPONENT = 1.5


def follow(process: Process, drive: float, tau: float, h: float) -> float:
    """Moves the first state towards its drive for h seconds; the rate at which it set out."""
    x = process.states[0]
    process.states[0] = drive + (x - drive) * math.exp(-h / tau)
    return (drive - x) / tau


@dataclass
class SpeedByDirection(Process):
    """Heats at one speed and cools at another (times of its time constant)."""

    up: float = 1.0
    down: float = 1.0

    def advance(self, drive: float, h: float) -> float:
        return follow(self, drive, self.taus[0] * (self.up if drive > self.states[0] else self.down), h)


@dataclass
class SpeedByLevel(Process):
    """A time constant that grows with the level; the gain stays. sensitivity: of its logarithm, per unit of PV."""

    sensitivity: float = 0.0

    def advance(self, drive: float, h: float) -> float:
        exponent = min(max(self.sensitivity * self.states[0], -MOST_EXPONENT), MOST_EXPONENT)
        return follow(self, drive, self.taus[0] * math.exp(exponent), h)


@dataclass
class RelayInside(Process):
    """A fan that switches on above a level and off below a lower one, and takes `size` while it runs."""

    size: float = 0.0
    on_above: float = 0.0
    off_below: float = 0.0
    runs: bool = False

    def advance(self, drive: float, h: float) -> float:
        x = self.states[-1]
        self.runs = x > self.on_above or (self.runs and x > self.off_below)
        return super().advance(drive - self.size * self.runs, h)


@dataclass
class DelayByFlow(Process):
    """A pipe that is passed quicker the more flows: its dead time falls with the valve's position."""

    sensitivity: float = 0.0
    past: deque[float] = field(default_factory=lambda: deque([0.0] * 4000, maxlen=4000))
    filling: float = 0.0

    def step(self, v: float, load: float = 0.0) -> float:
        h = self.ts / SUBSTEPS
        rate = 0.0
        for _ in range(SUBSTEPS):
            self.past.append(v)
            exponent = min(max(-self.sensitivity * v, -MOST_EXPONENT), MOST_EXPONENT)
            late = self.dead_time * math.exp(exponent)
            # What is in the pipe goes on; the delay moves no faster than time itself.
            self.filling += min(max(late - self.filling, -0.5 * h), 0.5 * h)
            back = min(int(self.filling / h), len(self.past) - 1)
            rate = self.advance(self.gain * self.past[-1 - back] + load, h)
        return self.states[-1] - self.zero * rate


@dataclass
class Resonant(Process):
    """Second order with complex poles. damping: of 1; natural_s: one over the natural frequency."""

    damping: float = 0.3
    natural_s: float = 1.0
    moving: float = 0.0

    def advance(self, drive: float, h: float) -> float:
        for _ in range(4):
            force = (drive - self.states[0]) / self.natural_s**2 - 2.0 * self.damping / self.natural_s * self.moving
            self.moving += 0.25 * h * force
            self.states[0] += 0.25 * h * self.moving
        return self.moving


@dataclass
class Igniting(Process):
    """Heat of its own above a level, none below: two steady states for one valve position."""

    heat: float = 0.0
    width: float = 1.0

    def advance(self, drive: float, h: float) -> float:
        x = self.states[0]
        return super().advance(drive + self.heat * math.tanh(x / self.width), h)


@dataclass
class Adapting(Process):
    """A gain that follows what the valve did before: a catalyst that wakes up. share: of the gain per unit of OP."""

    share: float = 0.0
    memory_s: float = 1.0
    woken: float = 0.0

    def step(self, v: float, load: float = 0.0) -> float:
        self.woken += (1.0 - math.exp(-self.ts / self.memory_s)) * (v - self.woken)
        return super().step(v * (1.0 + min(max(self.share * self.woken, -0.8), 2.0)), load)


@dataclass
class LagByDirection(Sensor):
    """A thermometer that warms at one speed and cools at another, s."""

    up: float
    down: float
    ts: float
    shown: float = 0.0

    def step(self, level: float) -> float:
        tau = self.up if level > self.shown else self.down
        self.shown = level + (self.shown - level) * math.exp(-self.ts / max(tau, 1e-9))
        return self.shown


@dataclass
class Analyser(Sensor):
    """Takes a sample every so many, and shows its last result until the next."""

    every: int
    at: int = 0
    taken: float = 0.0
    shown: float = 0.0

    def step(self, level: float) -> float:
        self.taken = level if self.at % self.every == 0 else self.taken
        return self.taken

    def show(self, reading: float) -> float:
        self.shown = reading if self.at % self.every == 0 else self.shown
        self.at += 1
        return self.shown


@dataclass
class SpeedReading(Sensor):
    """Reads more while PV moves, whichever way: by the square of its speed."""

    share: float
    ts: float
    tau: float
    slow: float = 0.0

    def step(self, level: float) -> float:
        self.slow += (1.0 - math.exp(-self.ts / self.tau)) * (level - self.slow)
        return level + self.share * (level - self.slow) ** 2


@dataclass
class Ratchet(Valve):
    """Follows an opening OP by more than a closing one, and creeps back to it (share a sample)."""

    up: float
    down: float
    creep: float
    last: float | None = None
    x: float = 0.0

    def step(self, u: float) -> float:
        if self.last is None:
            self.last = self.x = u
        moved, self.last = u - self.last, u
        self.x += (self.up if moved > 0.0 else self.down) * moved
        self.x += self.creep * (u - self.x)
        return self.x


@dataclass
class WindingSlave(Valve):
    """A flow loop inside: its valve ends at a limit, its integral goes on, and OP must come back for as long."""

    gain: float
    reset: float
    limit: float
    tau: float
    flow: float = 0.0
    integral: float = 0.0

    def step(self, u: float) -> float:
        error = u - self.flow
        self.integral += self.reset * error
        opening = min(self.gain * error + self.integral, self.limit)
        self.flow += (opening - self.flow) / (1.0 + self.tau)
        return self.flow
