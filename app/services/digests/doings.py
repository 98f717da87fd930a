"""What a digest asks for, each step once with all loops that it is asked for: one advice said ten times is not read."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from app.services.plant.work_list import Work
from app.services.telling.next_steps import apart

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
    groups: dict[tuple[str, str, str], list[Asked]] = {}
    for one in work:
        step, particular = apart(one.step)
        facts = "; ".join(fact for fact in (one.facts, particular) if fact)
        asked = Asked(one.loop, one.unit, facts, one.loop in new)
        groups.setdefault((one.verdict, one.told, step), []).append(asked)
    return [_doing(*head, sorted(loops, key=lambda one: not one.new)) for head, loops in groups.items()]


def _doing(verdict: str, told: str, step: str, loops: list[Asked]) -> Doing:
    kept = max(SHOWN, sum(one.new for one in loops))
    return Doing(verdict, told, step, loops[:kept], max(len(loops) - kept, 0))
