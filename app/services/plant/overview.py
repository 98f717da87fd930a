"""The plant as it stands: counts over all its loops, its units, and the tiles of its map."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from app.services.audit_json.numbers import or_none
from app.services.backend import Backend
from app.services.recency import OLD_FROM
from app.services.results import UnitView
from app.services.telling.health_classes import HEALTH_LIMITS
from app.services.telling.wording import relied_words
from app.storage import plant, set_apart
from app.storage.digests import CountRow
from app.storage.loops import count as count_loops
from app.storage.loops import count_retired, owners
from app.storage.newest import TOO_LITTLE_DATA
from app.storage.plant import UnitCount
from app.storage.set_apart import SetApart

MOST_TILES = 400  # what a browser lays out and paints at once
LEAST_TILES = 3
MEAN_DECIMALS, SUM_DIGITS = 3, 12
"""Of means and sums over loops that go out: what sums leave behind, as in 75.71000000000001, nobody has measured."""


@dataclass(frozen=True)
class Overview:
    """Counts over the newest verdict of each loop in service; `refused` is why loops are not auditable, by likely
    cause; `retired`: how many loops are left out. `reliable`, `apart`: as of `Tally`."""

    loops: int
    audited: int
    verdicts: dict[str, int]
    reliable: dict[str, int]
    refused: dict[str, int]
    units: list[UnitView]
    health: float | None
    retired: int = 0
    apart: dict[str, dict[str, int]] = field(default_factory=dict)

    def relied(self, verdict: str) -> str:
        """How many of the loops with that verdict are to be relied on, and how many are not any longer."""
        return relied_words(self.reliable.get(verdict, 0), self.apart.get(verdict, {}))


@dataclass(frozen=True)
class Tally:
    """Loops by verdict, of these the ones to rely on, and those that are not auditable by likely cause, the most
    frequent first. apart: by verdict and why, those that could be relied on when they were judged, and whose rows say
    something else."""

    verdicts: dict[str, int]
    reliable: dict[str, int]
    refused: dict[str, int]
    apart: dict[str, dict[str, int]]

    @property
    def sticking(self) -> int:
        """Valves that stick, to be relied on."""
        return self.reliable.get("stiction", 0)


def tally(counted: Iterable[UnitCount | CountRow], not_now: Iterable[SetApart]) -> Tally:
    verdicts, reliable, refused = Counter[str](), Counter[str](), Counter[str]()
    apart: dict[str, Counter[str]] = {}
    for row in counted:
        verdicts[row.verdict] += row.loops
        reliable[row.verdict] += row.loops * (row.reliability == "reliable")
        if row.verdict == "not_auditable":
            refused[cause_of_refusal(row.likely_cause)] += row.loops
    for one in not_now:
        reliable[one.verdict] -= one.loops
        apart.setdefault(one.verdict, Counter())[one.why] += one.loops
    why = {verdict: dict(counts) for verdict, counts in apart.items()}
    return Tally(dict(verdicts), dict(reliable), dict(refused.most_common()), why)


def cause_of_refusal(likely_cause: str | None) -> str:
    return likely_cause or TOO_LITTLE_DATA


def overview(backend: Backend) -> Overview:
    with backend.database.read() as connection:
        known, counted = count_loops(connection), plant.counts(connection)
        retired, apart = count_retired(connection), set_apart.of_newest(connection, OLD_FROM)
    told = tally(counted, apart)
    return Overview(
        loops=known,
        audited=sum(told.verdicts.values()),
        verdicts=told.verdicts,
        reliable=told.reliable,
        refused=told.refused,
        units=_units(counted),
        health=mean_health(counted),
        retired=retired,
        apart=told.apart,
    )


def tiles(backend: Backend) -> dict[str, list[Any]]:
    """For the treemap: units (name, loops, importance, health, and of each class of health how many loops have it and
    their mean) and their worst loops (tag, unit, importance, verdict, health), so many in all as can be drawn at once;
    `unit_tiles` has the others."""
    with backend.database.read() as connection:
        units = _units(plant.counts(connection))
        classes = {
            (row.unit, row.place): [row.loops, _mean(row.health)] for row in plant.healths(connection, HEALTH_LIMITS)
        }
        each = max(LEAST_TILES, MOST_TILES // max(len(units), 1))
        loops = plant.worst_of_units(connection, each)
    return {
        "units": [
            [
                *(unit.unit, unit.loops, unit.importance, unit.health),
                [classes.get((unit.unit, place), [0, None]) for place in range(len(HEALTH_LIMITS) + 2)],
            ]
            for unit in units
        ],
        "loops": [list(row) for row in loops],
    }


def unit_tiles(backend: Backend, unit: str | None) -> dict[str, list[Any]]:
    """The worst loops of one unit (None: of those that name none), as `tiles` has them."""
    with backend.database.read() as connection:
        return {"loops": [list(row) for row in plant.worst_of_unit(connection, unit, MOST_TILES)]}


def unit_names(backend: Backend) -> list[str]:
    with backend.database.read() as connection:
        return plant.units(connection)


def owner_names(backend: Backend) -> list[str]:
    with backend.database.read() as connection:
        return owners(connection)


def _units(counted: Iterable[UnitCount]) -> list[UnitView]:
    units: dict[str | None, list[UnitCount]] = {}
    for row in counted:
        units.setdefault(row.unit, []).append(row)
    return [_unit(unit, units[unit]) for unit in sorted(units, key=lambda unit: unit or "")]


def _unit(unit: str | None, rows: Sequence[UnitCount]) -> UnitView:
    counted: Counter[str] = Counter()
    for row in rows:
        counted[row.verdict] += row.loops
    importance = or_none(sum(row.importance for row in rows), SUM_DIGITS) or 0.0
    return UnitView(unit, counted.total(), dict(counted), mean_health(rows), importance)


def mean_health(rows: Sequence[UnitCount]) -> float | None:
    """Weighted by importance; loops whose verdict has no health are left out."""
    told = [(row.weight, row.weighted_health) for row in rows if row.weighted_health is not None]
    weight = sum(of_unit for of_unit, _ in told)
    return _mean(sum(health for _, health in told) / weight if weight else None)


def _mean(value: float | None) -> float | None:
    return None if value is None else round(value, MEAN_DECIMALS)
