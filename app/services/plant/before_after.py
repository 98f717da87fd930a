"""What a repair changed, in words and units: the last verdict before it beside the newest one after it."""

from dataclasses import dataclass
from typing import Any

from app.errors import NotFoundError
from app.services.audit_json.rows import KEY_FIGURES, as_row
from app.services.backend import Backend
from app.services.loops import OneLoop, find
from app.services.moments import PlantClock, iso_utc
from app.services.plant.loop_verdicts import verdict_detail
from app.services.rendering import figure
from app.services.telling.size_wording import equal_digits
from app.services.telling.wording import VERDICT_WORDS, health, measured_probability, probability, rely
from app.storage import notes, verdicts
from app.storage.repaired import sides

NONE = "–"
NOT_TOLD = "the record cannot tell"

Told = dict[str, Any]
Line = tuple[str, str, str]


@dataclass(frozen=True)
class Repair:
    """A loop before and after it was repaired: the last verdict before, the newest one after (None: none yet)."""

    repaired_at: str
    before: dict[str, Any] | None
    after: dict[str, Any] | None


def newest_repair(backend: Backend, loop: OneLoop) -> Repair | None:
    """The repair that was stated last with the verdicts on both sides of it, by the end of the audited window.

    A wrong time is mended by a further note with the right one; a repair that never was is withdrawn.
    """
    row = find(backend, loop)
    with backend.database.read() as connection:
        at = notes.repairs_stated_last(connection, [row.id]).get(row.id)
        if at is None:
            return None
        runs = sides(connection, row.id, at)
        found = verdicts.of_runs(connection, row.id, [run for run in (runs.before, runs.after) if run is not None])
    before, after = (as_row(found[run]) if run in found else None for run in (runs.before, runs.after))
    return Repair(iso_utc(at) or "", before, after)


def compared(backend: Backend, loop: OneLoop, repair: Repair | None, pv_unit: str | None) -> list[Line]:
    """Rows of what, before, after; empty where there is no verdict since the repair. The published band d is none of
    them: it is not the size of stiction, and reads as if some of it were left."""
    if repair is None or repair.after is None:
        return []
    sides = [_with_figures(backend, loop, side) for side in (repair.before, repair.after)]
    before, after = (_told(side, backend.clock, pv_unit or "unit of PV") for side in sides)
    return [(label, before.get(label, NONE), text) for label, text in after.items()]


def _with_figures(backend: Backend, loop: OneLoop, row: Told | None) -> Told | None:
    """A row of the history with the key figures that were stored beside it, as far as they are still kept."""
    if row is None:
        return None
    try:
        figures = verdict_detail(backend, loop, row["audit_id"]).get(KEY_FIGURES) or {}
    except NotFoundError:
        figures = {}
    return row | figures


def _told(row: Told | None, clock: PlantClock, pv_unit: str) -> dict[str, str]:
    if row is None:
        return {}
    return {
        "Verdict": VERDICT_WORDS[row["verdict"]],
        "Rely on it?": rely(row),
        "Audited window": _window(row, clock),
        "Probability of stiction": probability(measured_probability(row)),
        "Size of stiction S, units of OP (95 % interval)": _size(row),
        "Health, of 100": health(row["health"]),
        f"Control error SP - PV, standard deviation, {pv_unit}": _three(row.get("error_std")),
        "Travel of OP an hour, units of OP": figure(row.get("op_travel_per_h"), 1),
        "Reversals of OP an hour": figure(row.get("op_reversals_per_h"), 1),
        "Period of the oscillation, s": figure(row["oscillation_period_s"], 0),
        "Strength of the oscillation (0 none, 1 strongest)": figure(row["oscillation_strength"], 2),
    }


def _window(row: Told, clock: PlantClock) -> str:
    if row["window_start"] is None or row["window_end"] is None:
        return NONE
    return f"{clock.short(row['window_start'])} to {clock.short(row['window_end'])}"


def _size(row: Told) -> str:
    if row["verdict"] == "no_stiction":
        return "none to state"
    if row["stiction_S"] is None:
        return NOT_TOLD
    size, low, high = equal_digits(row["stiction_S"], row["stiction_S_low"], row["stiction_S_high"])
    return f"{size} ({low} to {high})"


def _three(value: float | None) -> str:
    return NONE if value is None else f"{value:.3g}"
