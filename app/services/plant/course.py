"""The plant night by night, as far back as a report looks: valves that stick, health, loops that are not judged."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Connection

from app.engine.codes import Cause
from app.services.backend import Backend
from app.services.outward import NightOfUnitOut, NightOut
from app.services.plant.overview import mean_health, tally
from app.services.plant.told_until import run_to_work_by
from app.services.recency import OLD_FROM
from app.storage import plant, set_apart
from app.storage.continuing import counts_in
from app.storage.plant import RunOfNight, UnitCount
from app.storage.set_apart import SetApart

NOT_IN_AUTOMATIC: Cause = "not_in_automatic"
NIGHTS = 14
RUNS = 2 * NIGHTS
"""Of several runs of one date the last counts; so many are looked through for the dates. A night that was caught up
after midnight has its own date."""


@dataclass(frozen=True)
class UnitColumn:
    """Valves that stick of one unit, night by night, or of several that have no column of their own."""

    label: str
    units: frozenset[str | None]

    def sticking(self, night: NightOut) -> int:
        return sum(night.of_units.get(unit, 0) for unit in self.units)


def unit_columns(nights: Sequence[NightOut], most: int) -> list[UnitColumn]:
    """Columns that add up to the whole: of `most` units, in which most valves stuck where there are more, of all others
    together, and of the loops that name none."""
    stuck = Counter[str | None]()
    for night in nights:
        stuck.update(night.of_units)
    named = sorted((unit for unit in stuck if unit is not None), key=lambda unit: (-stuck[unit], unit))
    shown, others = (named, []) if len(named) <= most else (named[: most - 1], named[most - 1 :])
    columns = [UnitColumn(unit, frozenset((unit,))) for unit in sorted(shown)]
    columns += [UnitColumn(f"{len(others)} other units", frozenset(others))] if others else []
    return [*columns, *([UnitColumn("no unit", frozenset((None,)))] if None in stuck else [])]


def course(backend: Backend) -> list[NightOut]:
    """The oldest first; some queries a night."""
    with backend.database.read() as connection:
        runs = reversed(plant.whole_runs(connection, RUNS))
        dated = {backend.clock.date_of_run(run.nightly_for, run.created_at): run for run in runs}
        newest, last = sorted(dated)[-NIGHTS:], run_to_work_by(connection) or 0
        return [_night(connection, date, dated[date], last) for date in newest]


def _night(connection: Connection, date: str, run: RunOfNight, last: int) -> NightOut:
    """last: the run to work by, of which what is written by now counts; of an older one what was when it ended."""
    counted = plant.counts_of_run(connection, run.id)
    until = run.ended_at if run.id < last else None
    apart = set_apart.of_run(connection, run.id, OLD_FROM, until, counts_in(run.id))
    told = tally(counted, apart)
    return NightOut(
        date=date,
        run=str(run.id),
        audited=sum(told.verdicts.values()),
        sticking=told.sticking,
        apart=sum(told.apart.get("stiction", {}).values()),
        health=mean_health(counted),
        in_manual=told.refused.get(NOT_IN_AUTOMATIC, 0),
        units=_of_units(counted, apart),
    )


def _of_units(counted: Sequence[UnitCount], apart: Sequence[SetApart]) -> tuple[NightOfUnitOut, ...]:
    """By name, loops without a unit last."""
    of_unit: defaultdict[str | None, tuple[list[UnitCount], list[SetApart]]] = defaultdict(lambda: ([], []))
    for row in counted:
        of_unit[row.unit][0].append(row)
    for one in apart:
        of_unit[one.unit][1].append(one)
    named = sorted(of_unit, key=lambda unit: (unit is None, unit or ""))
    return tuple(NightOfUnitOut(unit, tally(*of_unit[unit]).sticking) for unit in named)
