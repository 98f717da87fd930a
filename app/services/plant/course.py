"""The plant night by night, as far back as a report looks: valves that stick, health, loops that are not judged."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from app.engine.codes import Cause
from app.services.backend import Backend
from app.services.plant.overview import mean_health, tally
from app.storage import plant

NOT_IN_AUTOMATIC: Cause = "not_in_automatic"
NIGHTS = 14
RUNS = 2 * NIGHTS
"""Of several runs of one date the last counts; so many are looked through for the dates."""


@dataclass(frozen=True)
class PlantNight:
    """What the last whole run of a date said. sticking: valves that stick, to be relied on; health: mean, weighted by
    importance, None where no loop has one; in_manual: loops not judged because they are not in automatic. of_units: the
    same as `sticking` by unit."""

    date: str
    run: str
    audited: int
    sticking: int
    health: float | None
    in_manual: int
    of_units: dict[str | None, int]


def course(backend: Backend) -> list[PlantNight]:
    """The oldest first; a query a night."""
    with backend.database.read() as connection:
        dated = {backend.clock.date(began): run for run, began in reversed(plant.whole_runs(connection, RUNS))}
        newest = list(dated.items())[-NIGHTS:]
        return [_night(date, run, plant.counts_of_run(connection, run)) for date, run in newest]


def _night(date: str, run: int, counted: Sequence[Any]) -> PlantNight:
    told, of_units = tally(counted), Counter[str | None]()
    for row in counted:
        of_units[row.unit] += row.loops * (row.verdict == "stiction" and row.reliability == "reliable")
    return PlantNight(
        date=date,
        run=str(run),
        audited=sum(told.verdicts.values()),
        sticking=told.reliable.get("stiction", 0),
        health=mean_health(counted),
        in_manual=told.refused.get(NOT_IN_AUTOMATIC, 0),
        of_units=dict(of_units),
    )
