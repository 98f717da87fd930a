"""`python -m app.lab.testbench.structures`: loops that are wired otherwise than PV, SP and one PI controller.

Cascades, split range, overrides, levels that are let swing, profiles, set points from above, feedforward, ratios: each
kind with a healthy valve and with one that sticks. Prints what the audit says of each kind. None of these loops is in
any fit.
"""

import math
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from app.engine.audit import audit
from app.engine.plant_wide.cascades import cascades
from app.engine.plant_wide.excerpts import excerpts_of
from app.engine.plant_wide.groups import Candidate
from app.engine.recording import FloatArray, Recording
from app.lab.testbench.seeded import print_report
from app.lab.testbench.wiring import Lag, Pi, Valve, Wandering
from app.services.auditing.hearing import Said, hear

SAMPLES, SETTLING, INTERVAL_S = 1500, 500, 5.0
STICKING = (3.0, 10.0)  # bounds of S, per cent of OP's span

Row = tuple[float, float, float]
"""SP, PV and OP of one scan."""


@dataclass(frozen=True)
class Parts:
    """What the loops of all kinds have in common. S, J: of the valve, per cent; 0: healthy. tau_s: of the process, s;
    K: its gain. noise: standard deviation of the measurement.
    """

    rng: np.random.Generator
    S: float
    J: float
    K: float
    tau_s: float
    noise: float

    def valve(self, start: float = 50.0) -> Valve:
        return Valve(start, self.S, self.J)

    def measured(self, true: float) -> float:
        return true + self.noise * float(self.rng.standard_normal())

    def load(self, sd: float = 1.0) -> Wandering:
        return Wandering(self.rng, sd, float(self.rng.uniform(5.0, 40.0)) * self.tau_s)

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def plant(self) -> Lag:
        return Lag(self.K, self.tau_s, 1 + round(self.between(0.1, 0.4) * self.tau_s / INTERVAL_S))

    def controller(self, start: float = 50.0) -> Pi:
        """Ordinary tuning for plant()."""
        return Pi(self.between(0.4, 1.0) / self.K, self.tau_s * self.between(0.8, 1.5), start)


def parts_of(seed: int, sticks: bool) -> Parts:
    rng = np.random.default_rng([seed, int(sticks)])
    S = float(rng.uniform(*STICKING)) if sticks else 0.0
    return Parts(rng, S, S * float(rng.uniform(0.2, 1.0)), float(rng.uniform(0.6, 1.6)), float(rng.uniform(15.0, 80.0)),
                 float(rng.uniform(0.03, 0.2)))  # fmt: skip


def _still(_: int) -> float:
    return 0.0


def _single(
    p: Parts, sp: Callable[[int], float], ahead: float = 0.0, timed: Callable[[int], float] = _still
) -> Iterator[Row]:
    """One PI controller. sp: of the scan. ahead: share of a measured load that feedforward takes away. timed: what else
    comes from outside, of the scan.
    """
    valve, plant, pi, load, known = p.valve(), p.plant(), p.controller(), p.load(), p.load(3.0 if ahead else 0.0)
    position, disturbed = 0.0, 2.5
    for k in range(SETTLING + SAMPLES):
        felt = known.after(INTERVAL_S)
        pv = p.measured(50.0 + plant.after(position + disturbed + felt, INTERVAL_S))
        op = min(max(pi.output(sp(k) - pv, INTERVAL_S) - ahead * felt, 0.0), 100.0)
        position, disturbed = valve.to(op) - 50.0, 2.5 + load.after(INTERVAL_S) + timed(k)
        yield sp(k), pv, op


def timed_load(p: Parts) -> Iterator[Row]:
    """A timer opens and closes something upstream: a triangle comes through, one ramp of it longer than the other."""
    period, rising, size = p.tau_s * p.between(4.0, 15.0), p.between(0.2, 0.8), p.between(2.0, 8.0)
    corners = [0.0, rising * period, period]
    return _single(
        p, lambda _: 50.0, timed=lambda k: float(np.interp(k * INTERVAL_S % period, corners, [-size, size, -size]))
    )


def plain(p: Parts) -> Iterator[Row]:
    return _single(p, lambda _: 50.0)


def feedforward(p: Parts) -> Iterator[Row]:
    return _single(p, lambda _: 50.0, ahead=p.between(0.6, 1.0))


def batch_profile(p: Parts) -> Iterator[Row]:
    """Ramp up, hold, ramp down, hold."""
    ramp, hold, height = int(p.between(40, 120)), int(p.between(60, 200)), p.between(10.0, 25.0)
    corners = np.cumsum([0, ramp, hold, ramp, hold])
    return _single(p, lambda k: 45.0 + float(np.interp(k % corners[-1], corners, [0, height, height, 0, 0])))


def set_points_from_above(p: Parts) -> Iterator[Row]:
    """A predictive controller moves the set point by a little every few scans."""
    every, size = int(p.between(6, 30)), p.between(0.2, 1.0)
    moves = p.rng.normal(0.0, size, SETTLING + SAMPLES)
    wandering = np.zeros(SETTLING + SAMPLES)
    for k in range(1, len(wandering)):
        wandering[k] = 0.95 * wandering[k - 1] + moves[k] if k % every == 0 else wandering[k - 1]
    return _single(p, lambda k: 50.0 + float(wandering[k]))


def ratio(p: Parts) -> Iterator[Row]:
    """The set point is a share of a wild flow, which is measured with noise."""
    share, noise, tau_s = p.between(0.5, 1.5), p.noise, p.tau_s * p.between(2.0, 20.0)
    wild = Wandering(p.rng, p.between(1.0, 4.0), tau_s)
    flows = [wild.after(INTERVAL_S) + noise * float(p.rng.standard_normal()) for _ in range(SETTLING + SAMPLES)]
    return _single(p, lambda k: 50.0 + share * flows[k])


def _cascade(p: Parts, which: str) -> Iterator[Row]:
    valve, inner_plant, inner, load = p.valve(), Lag(p.K, 5.0, 1), Pi(0.4 / p.K, 8.0, 50.0), p.load()
    slow = p.tau_s * p.between(3.0, 8.0)
    outer_plant, outer = Lag(1.0, slow, 1 + round(0.15 * slow / INTERVAL_S)), Pi(p.between(0.8, 2.0), slow, 50.0)
    flow = position = disturbed = 0.0
    for _ in range(SETTLING + SAMPLES):
        temperature = p.measured(50.0 + outer_plant.after(flow + disturbed, INTERVAL_S))
        asked = outer.output(50.0 - temperature, INTERVAL_S)
        flow = inner_plant.after(position, INTERVAL_S)
        measured = p.measured(50.0 + flow)
        op = inner.output(asked - measured, INTERVAL_S)
        position, disturbed = valve.to(op) - 50.0, 2.5 + 2.0 * load.after(INTERVAL_S)
        yield (asked, measured, op) if which == "inner" else (50.0, temperature, asked)


def cascade_inner(p: Parts) -> Iterator[Row]:
    return _cascade(p, "inner")


def cascade_outer(p: Parts) -> Iterator[Row]:
    return _cascade(p, "outer")


def split_range(p: Parts) -> Iterator[Row]:
    """OP above 50 % opens the heating valve, below it the cooling valve, which is stronger; the load passes zero."""
    heating, cooling, plant, pi, load = p.valve(0.0), p.valve(0.0), p.plant(), p.controller(), p.load(8.0)
    stronger, felt = p.between(1.2, 2.0), 0.0
    for _ in range(SETTLING + SAMPLES):
        pv = p.measured(50.0 + plant.after(felt, INTERVAL_S))
        op = pi.output(50.0 - pv, INTERVAL_S)
        heat, cold = heating.to(max(2.0 * (op - 50.0), 0.0)), cooling.to(max(2.0 * (50.0 - op), 0.0))
        felt = 0.5 * (heat - stronger * cold) + load.after(INTERVAL_S)
        yield 50.0, pv, op


def override(p: Parts) -> Iterator[Row]:
    """The lower of a flow's and a pressure's controller moves the valve; the flow and that OP are recorded."""
    valve, plant, pi, load = p.valve(), p.plant(), p.controller(), p.load(3.0)
    pressure_plant, pressure_pi = Lag(p.K, 2.0 * p.tau_s, 2), Pi(0.5 / p.K, 2.0 * p.tau_s, 50.0)
    position = disturbed = 0.0
    for _ in range(SETTLING + SAMPLES):
        pv = p.measured(50.0 + plant.after(position, INTERVAL_S))
        pressure = p.measured(48.0 + pressure_plant.after(position + disturbed, INTERVAL_S))
        flow_error, pressure_error = 50.0 - pv, 50.0 - pressure
        op = min(pi.output(flow_error, INTERVAL_S), pressure_pi.output(pressure_error, INTERVAL_S))
        pi.follow(op, flow_error)
        pressure_pi.follow(op, pressure_error)
        position, disturbed = valve.to(op) - 50.0, load.after(INTERVAL_S)
        yield 50.0, pv, op


def _level(p: Parts, pi: Pi, gain: Callable[[float], float], wander: float) -> Iterator[Row]:
    """A level over its outlet valve. gain: of the controller, by control error."""
    valve, load, hold_s = p.valve(), Wandering(p.rng, wander, 10.0 * p.tau_s), p.between(200.0, 800.0)
    level = 0.0
    position = 50.0
    for _ in range(SETTLING + SAMPLES):
        level = min(max(level + (50.0 + load.after(INTERVAL_S) - position) * INTERVAL_S / hold_s, -50.0), 50.0)
        pv = p.measured(50.0 + level)
        op = pi.output(pv - 50.0, INTERVAL_S, gain(abs(pv - 50.0)))
        position = valve.to(op)
        yield 50.0, pv, op


def averaging_level(p: Parts) -> Iterator[Row]:
    """Proportional only, so that the vessel takes up what comes in."""
    return _level(p, Pi(p.between(0.8, 2.0), math.inf, 50.0), lambda _: 1.0, 6.0)


def error_squared_level(p: Parts) -> Iterator[Row]:
    return _level(p, Pi(p.between(2.0, 6.0), p.between(300.0, 1500.0), 50.0), lambda error: 0.05 + error / 20.0, 4.0)


def gap_level(p: Parts) -> Iterator[Row]:
    """A fifth of the gain within a gap around the set point."""
    half = p.between(2.0, 6.0)
    pi = Pi(p.between(1.5, 4.0), p.between(400.0, 1500.0), 50.0)
    return _level(p, pi, lambda error: 1.0 if error > half else 0.2, 5.0)


def on_off(p: Parts) -> Iterator[Row]:
    """A thermostat: OP is 20 or 80 %."""
    valve, plant, load, half, op = p.valve(), p.plant(), p.load(), p.between(1.0, 4.0), 20.0
    position = 0.0
    for _ in range(SETTLING + SAMPLES):
        pv = p.measured(50.0 + plant.after(position + load.after(INTERVAL_S), INTERVAL_S))
        op = 80.0 if pv < 50.0 - half else 20.0 if pv > 50.0 + half else op
        position = valve.to(op) - 50.0
        yield 50.0, pv, op


def time_proportioned(p: Parts) -> Iterator[Row]:
    """A contactor that is closed for OP per cent of each cycle: it has no valve and cannot stick."""
    plant, pi, load, cycle = p.plant(), p.controller(), p.load(), int(p.between(4, 30))
    power, share = 0.0, 50.0
    for k in range(SETTLING + SAMPLES):
        pv = p.measured(50.0 + plant.after(power + load.after(INTERVAL_S), INTERVAL_S))
        op = pi.output(50.0 - pv, INTERVAL_S)
        share = op if k % cycle == 0 else share
        power = 50.0 if (k % cycle) < cycle * share / 100.0 else -50.0
        yield 50.0, pv, op


Kind = Callable[[Parts], Iterator[Row]]
Tally = defaultdict[tuple[str, bool], Counter[str]]
"""How often what was said, by the name of the kind and whether the valve sticks."""

WITH_A_VALVE: tuple[Kind, ...] = (
    plain, timed_load, feedforward, ratio, set_points_from_above, batch_profile, cascade_inner, cascade_outer,
    split_range, override, averaging_level, error_squared_level, gap_level, on_off,
)  # fmt: skip
KINDS: tuple[Kind, ...] = (*WITH_A_VALVE, time_proportioned)


def record(kind: Kind, seed: int, sticks: bool) -> Recording:
    """The record of SAMPLES samples of a loop of that kind, stored to a hundredth."""
    rows: FloatArray = np.round(np.array(list(kind(parts_of(seed, sticks))), dtype=np.float64)[SETTLING:], 2)
    time_s: FloatArray = INTERVAL_S * np.arange(len(rows), dtype=np.float64)
    sp, pv, op = rows.T
    return Recording(f"{kind.__name__} {seed}", time_s, pv.copy(), op.copy(), sp.copy())


def said_of(kind: Kind, seed: int, sticks: bool) -> str:
    """The verdict, with an exclamation mark where it is reliable."""
    judgement = audit(record(kind, seed, sticks)).judgement
    return _marked(judgement.verdict, reliable=judgement.reliability == "reliable")


def said_beside(seed: int, sticks: bool) -> dict[str, str]:
    """The same of the two loops of a cascade that are heard beside each other, as those of one plant are."""
    records = {kind.__name__: record(kind, seed, sticks) for kind in (cascade_inner, cascade_outer)}
    audits = {tag: audit(one) for tag, one in records.items()}
    said = {
        tag: Said(found.judgement.verdict, found.judgement.reliability, found.judgement.stiction_probability)
        for tag, found in audits.items()
    }
    swinging = [Candidate(t, a.swing, said[t].stiction_probability) for t, a in audits.items() if a.swing is not None]
    kept = {tag: excerpts for tag, one in records.items() if (excerpts := excerpts_of(one, 0.0)) is not None}
    heard = hear(said, swinging, cascades(kept))
    doubted = {tag for tag, one in heard.items() if one.doubt is not None}
    return {
        f"{tag}, beside the other": _marked(one.verdict, reliable=one.relied_on and tag not in doubted)
        for tag, one in said.items()
    }


def _marked(verdict: str, *, reliable: bool) -> str:
    return verdict + "!" * reliable


def tallied(seeds: Iterable[int]) -> Tally:
    said: Tally = defaultdict(Counter)
    for seed, sticks in product(seeds, (False, True)):
        for kind in WITH_A_VALVE if sticks else KINDS:
            said[kind.__name__, sticks][said_of(kind, seed, sticks)] += 1
        for name, verdict in said_beside(seed, sticks).items():
            said[name, sticks][verdict] += 1
    return said


def report(said: Tally) -> Iterator[str]:
    yield (
        "| wiring | healthy: sticks | reliably | cleared reliably "
        "| sticking: sticks | reliably | cleared reliably | not auditable |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    names = [kind.__name__ for kind in KINDS]
    beside = [name for name in dict.fromkeys(name for name, _ in said) if name not in names]
    for title, summed in [*((name, [name]) for name in names), ("all", names), *((name, [name]) for name in beside)]:
        healthy, sticking = (sum((said[name, sticks] for name in summed), Counter()) for sticks in (False, True))
        cells = [_cells(healthy), _cells(sticking) if sticking else " |  | "]
        refused = healthy["not_auditable"] + sticking["not_auditable"]
        counts = f"({healthy.total()}, {sticking.total()})"
        yield f"| {title.replace('_', ' ')} {counts} | {' | '.join(cells)} | {refused} |"


def _cells(said: Counter[str]) -> str:
    return f"{said['stiction'] + said['stiction!']} | {said['stiction!']} | {said['no_stiction!']}"


def main(arguments: list[str] | None = None) -> int:
    return print_report("structures", __doc__, lambda seeds: report(tallied(seeds)), arguments, many=30, seed=1000)


if __name__ == "__main__":
    sys.exit(main())
