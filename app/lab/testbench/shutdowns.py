"""`python -m app.lab.testbench.shutdowns`: units that are shut down with their loops in automatic, cards that fail, and
transmitters that die each by itself.

In each plant of 83 hours something happens to the loops of one unit (a flow, a level, one under slow control, in turn),
and one transmitter of another unit dies some hours before; or ten die at random times. Prints of how many loops it is
said that PV stands, of how many that they came to stand together, and whether the one that died by itself is apart.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from app.engine.fitness import assess
from app.engine.plant_wide.stood_together import Stand, stood_together
from app.engine.recording import Recording
from app.lab.testbench.seeded import print_report
from app.lab.testbench.standstills import HOUR, INTERVAL_S, PROCESSES, SAMPLES, Plant

BEFORE_END, ALONE_BEFORE_END = 20 * HOUR, 33 * HOUR
MINUTE = round(60.0 / INTERVAL_S)
NOTHING_FLOWS = -300.0

Made = Callable[[Plant, int], Plant]
"""What happens to a loop at a sample."""


def without_feed(plant: Plant, at: int) -> Plant:
    """PV falls to the end of its span and stands there; SP is left, and OP runs to its limit."""
    return replace(plant, upset=lambda k: NOTHING_FLOWS if k >= at else 0.0)


def held(plant: Plant, at: int) -> Plant:
    """PV stands where it was, as in a unit that is blocked in, and behind a card that fails; OP winds up."""
    return replace(plant, frozen_from=at)


@dataclass(frozen=True)
class Kind:
    """made: what happens to each of so many loops. minutes: within so many they are reached; None: each at a time of
    its own."""

    made: Made
    loops: int
    minutes: float | None


KINDS = {
    "blocked in within 20 min": Kind(held, 8, 20.0),
    "blocked in within 45 min": Kind(held, 8, 45.0),
    "without feed within 20 min": Kind(without_feed, 8, 20.0),
    "the same, 24 loops": Kind(without_feed, 24, 20.0),
    "a card of 8 fails": Kind(held, 8, 0.0),
    "10 die by themselves": Kind(held, 10, None),
}


@dataclass(frozen=True)
class Told:
    """What is told of one plant: loops to which it happened, of how many it is said that PV stands, how many of these
    are in groups, of how many groups, and whether the transmitter that died by itself is in one."""

    loops: int
    stand: int
    together: int
    groups: int
    alone_in_group: bool


def told(kind: Kind, seed: int) -> Told:
    rng = np.random.default_rng([seed, 8])
    if kind.minutes is None:
        at = rng.integers(3 * HOUR, SAMPLES - 2 * HOUR, kind.loops).tolist()
    else:
        at = (SAMPLES - BEFORE_END + np.sort(rng.uniform(0.0, kind.minutes, kind.loops)) * MINUTE).astype(int).tolist()
    stands = [_stand(f"loop {k}", kind.made, first, seed, k) for k, first in enumerate(at)]
    alone = None if kind.minutes is None else _stand("alone", held, SAMPLES - ALONE_BEFORE_END, seed, 99)
    groups = stood_together([one for one in (*stands, alone) if one is not None])
    tags = [stand.tag for group in groups for stand in group.stands]
    found = sum(one is not None for one in stands)
    return Told(len(at), found, len(set(tags) - {"alone"}), len(groups), "alone" in tags)


def _stand(tag: str, made: Made, at: int, seed: int, number: int) -> Stand | None:
    """Since when the loop stands, as the audit sees it; None where it does not say so."""
    plant = Plant(np.random.default_rng([seed, number]), PROCESSES[number % len(PROCESSES)])
    sp, pv, op = made(plant, at).run()
    time_s = INTERVAL_S * np.arange(SAMPLES, dtype=np.float64)
    stands = assess(Recording(tag, time_s, pv, op, sp, np.ones(SAMPLES, np.bool_))).standstill
    if stands is None or stands.from_start:
        return None
    return Stand(tag, stands.since_s, SAMPLES * INTERVAL_S, INTERVAL_S)


def report(seeds: range) -> Iterator[str]:
    plants = len(seeds)
    yield "| what happened | PV stands | of these told of together | groups | the one alone in a group |"
    yield "|---|---|---|---|---|"
    for name, kind in KINDS.items():
        found = [told(kind, seed) for seed in seeds]
        loops, stand, together = (sum(getattr(one, what) for one in found) for what in ("loops", "stand", "together"))
        groups, alone = sum(one.groups for one in found), sum(one.alone_in_group for one in found)
        yield f"| {name} | {stand} of {loops} | {together} | {groups} in {plants} plants | {alone} of {plants} |"


def main(arguments: list[str] | None = None) -> int:
    return print_report("shutdowns", __doc__, report, arguments, many=6, seed=0, of="plants")


if __name__ == "__main__":
    sys.exit(main())
