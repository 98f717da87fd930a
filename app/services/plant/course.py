"""The plant night by night, as far back as a report looks: valves that stick, health, loops that are not judged."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

from app.engine.codes import Cause
from app.services.backend import Backend
from app.services.plant.overview import mean_health, tally
from app.services.results import Night, NightOfUnit
from app.storage import plant

NOT_IN_AUTOMATIC: Cause = "not_in_automatic"
NIGHTS = 14
RUNS = 2 * NIGHTS
"""Of several runs of one date the last counts; so many are looked through for the dates."""


def course(backend: Backend) -> list[Night]:
    """The oldest first; a query a night."""
    with backend.database.read() as connection:
        dated = {backend.clock.date(began): run for run, began in reversed(plant.whole_runs(connection, RUNS))}
        newest = list(dated.items())[-NIGHTS:]
        return [_night(date, run, plant.counts_of_run(connection, run)) for date, run in newest]


def _night(date: str, run: int, counted: Sequence[Any]) -> Night:
    told, of_units = tally(counted), Counter[str | None]()
    for row in counted:
        of_units[row.unit] += row.loops * (row.verdict == "stiction" and row.reliability == "reliable")
    return Night(
        date=date,
        run=str(run),
        audited=sum(told.verdicts.values()),
        sticking=told.reliable.get("stiction", 0),
        health=mean_health(counted),
        in_manual=told.refused.get(NOT_IN_AUTOMATIC, 0),
        units=tuple(
            NightOfUnit(unit, of_units[unit]) for unit in sorted(of_units, key=lambda one: (one is None, one or ""))
        ),
    )
