"""The bench in tables: what was called what on each level of each factor, and where the detector starts to fail."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from app.lab.testbench.running import Outcome

FEWEST_FOUND, MOST_ACCUSED = 0.8, 0.2
"""A level fails where fewer of the sticky valves are found, or more of the healthy ones accused."""

_HEAD = ("loops", "at rest", "called", "abstains", "wrong, reliable", "right, reliable", "median p")
_WIDTHS = (20, 5, 7, 6, 8, 15, 15, 8)


@dataclass(frozen=True)
class Group:
    """Loops of one truth on one level. Shares are of `loops`, the exercised ones; None where there are none.

    rested: sticky valves that were not exercised, left out of everything else. called: verdict "stiction".
    probability: median of the stated ones.
    """

    loops: int
    rested: int
    called: float | None
    abstained: float | None
    wrong_reliable: float | None
    right_reliable: float | None
    probability: float | None


@dataclass(frozen=True)
class Row:
    """One level of one factor."""

    factor: str
    level: str
    sticky: Group
    healthy: Group

    @property
    def misses(self) -> bool:
        return self.sticky.called is not None and self.sticky.called < FEWEST_FOUND

    @property
    def accuses(self) -> bool:
        return self.healthy.called is not None and self.healthy.called > MOST_ACCUSED


def rows(outcomes: Sequence[Outcome]) -> list[Row]:
    """One row a level, in the order in which factors and levels first come."""
    places = dict.fromkeys((o.factor, o.level) for o in outcomes)
    found = []
    for factor, level in places:
        here = [o for o in outcomes if (o.factor, o.level) == (factor, level)]
        found.append(Row(factor, level, group(o for o in here if o.sticky), group(o for o in here if not o.sticky)))
    return found


def group(outcomes: Iterable[Outcome]) -> Group:
    everything = list(outcomes)
    seen = [o for o in everything if o.exercised]
    rested, n = len(everything) - len(seen), len(seen)
    if n == 0:
        return Group(0, rested, None, None, None, None, None)
    stated = [o.probability for o in seen if o.probability is not None]
    return Group(
        loops=n,
        rested=rested,
        called=sum(o.verdict == "stiction" for o in seen) / n,
        abstained=sum(o.abstained for o in seen) / n,
        wrong_reliable=sum(o.wrong and o.reliable for o in seen) / n,
        right_reliable=sum(not o.wrong and not o.abstained and o.reliable for o in seen) / n,
        probability=float(np.median(stated)) if stated else None,
    )


def factors(table: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row.factor for row in table))


def markdown(table: Sequence[Row]) -> str:
    """A table for each factor."""
    return "\n\n".join(_factor(factor, [r for r in table if r.factor == factor]) for factor in factors(table))


def _factor(factor: str, table: Sequence[Row]) -> str:
    parts = []
    for name, groups in (("sticky", [r.sticky for r in table]), ("healthy", [r.healthy for r in table])):
        if any(g.loops + g.rested for g in groups):
            lines = [_line([r.level, *_cells(g)]) for r, g in zip(table, groups, strict=True) if g.loops + g.rested]
            parts.append("\n".join([_line([f"{name} loops", *_HEAD]), _line(["-" * w for w in _WIDTHS]), *lines]))
    return f"### {factor[0].upper()}{factor[1:]}\n\n" + "\n\n".join(parts)


def _cells(found: Group) -> list[str]:
    shares = (found.called, found.abstained, found.wrong_reliable, found.right_reliable)
    return [str(found.loops), str(found.rested), *map(_percent, shares), _number(found.probability)]


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100.0 * share:.0f} %"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _line(cells: Sequence[str]) -> str:
    padded = (f"{cell:{side}{w}}" for cell, w, side in zip(cells, _WIDTHS, "<" + 7 * ">", strict=True))
    return "| " + " | ".join(padded) + " |"


def failing(table: Sequence[Row]) -> str:
    """Each factor with the levels on which the detector misses sticky valves or accuses healthy ones."""
    lines = ["| factor | sticky valves missed at | healthy valves accused at |", "| --- | --- | --- |"]
    for factor in factors(table):
        here = [row for row in table if row.factor == factor]
        missed = ", ".join(f"{r.level} ({_percent(r.sticky.called)} found)" for r in here if r.misses)
        accused = ", ".join(f"{r.level} ({_percent(r.healthy.called)})" for r in here if r.accuses)
        lines.append(f"| {factor} | {missed or '-'} | {accused or '-'} |")
    return "\n".join(lines)


def calibration(outcomes: Sequence[Outcome]) -> str:
    """Stated probability against the share of sticky valves among the loops that it was stated of."""
    stated = [(o.probability, o.sticky) for o in outcomes if o.probability is not None and o.exercised]
    probability, sticky = (np.array(x, dtype=np.float64) for x in zip(*stated, strict=True))
    lines = ["| stated | loops | mean stated | sticky |", "| --- | --- | --- | --- |"]
    for low in np.arange(0.0, 1.0, 0.2):
        inside = (probability >= low) & ((probability < low + 0.2) | ((low > 0.7) & (probability <= 1.0)))
        if inside.any():
            cells = (f"{low:.1f} to {low + 0.2:.1f}", str(inside.sum()), f"{probability[inside].mean():.2f}")
            lines.append(f"| {' | '.join(cells)} | {sticky[inside].mean():.2f} |")
    return "\n".join(lines)
