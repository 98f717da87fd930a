"""What a digest asks for, each step once with all loops that it is asked for: one advice said ten times is not read."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from app.services.plant.work_list import Work

SHOWN = 15


@dataclass(frozen=True)
class Asked:
    """A loop, and what is known of it in one line. new: whether it is newly said to stick."""

    loop: str
    unit: str | None
    facts: str
    new: bool


@dataclass(frozen=True)
class Doing:
    """What is said of the loops and what to do about them; more: how many of them are not listed."""

    verdict: str
    told: str
    step: str
    loops: list[Asked]
    more: int


def doings(work: Sequence[Work], new: Collection[str]) -> list[Doing]:
    """In the order of the first loop of each; `new`: tags of loops that are newly said to stick, which come first in
    each and are always listed."""
    groups: dict[tuple[str, str, str], list[Work]] = {}
    for one in work:
        groups.setdefault((one.verdict, one.told, one.step.code), []).append(one)
    return [_doing(together, new) for together in groups.values()]


def _doing(work: Sequence[Work], new: Collection[str]) -> Doing:
    first, loops = work[0], sorted((_asked(one, new) for one in work), key=lambda one: not one.new)
    kept = max(SHOWN, sum(one.new for one in loops))
    return Doing(first.verdict, first.told, first.step.asks, loops[:kept], max(len(loops) - kept, 0))


def _asked(one: Work, new: Collection[str]) -> Asked:
    facts = "; ".join(fact for fact in (one.facts, one.step.besides) if fact)
    return Asked(one.loop, one.unit, facts, one.loop in new)
