"""Which period each figure of a verdict belongs to: the record that was given, the window, and the stretch judged."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from app.services.backend import Backend
from app.services.loops import OneLoop, find
from app.services.moments import PlantClock, iso_utc, moment_of
from app.services.plant.charts import judged_stretch
from app.services.rendering import figure
from app.storage import verdicts
from app.storage.loops import LoopRow

A_DAY = timedelta(days=1)


@dataclass(frozen=True)
class Periods:
    """lines: record, window and what was identified, each with its samples and times. of_figures: of what period the
    key figures are, which are of the whole record. of_old: of when the stretch is that speaks for the record, where it
    ended more than a day before the newest sample."""

    lines: tuple[str, ...]
    of_figures: str
    of_old: str = ""


def periods(backend: Backend, loop: OneLoop, row: Mapping[str, Any], detail: Mapping[str, Any]) -> Periods:
    """`row`: of the newest verdict; `detail`: what was stored beside it."""
    ends = _ends(backend, find(backend, loop), int(row["audit_id"]))
    between = f", {_span(backend.clock, *ends)}" if ends else ""
    lines = [f"Record: {row['samples']:,} samples every {figure(row['sampling_interval_s'], 1)} s{between}."]
    whole = "of the whole record" + between
    window, identified = detail.get("window"), detail.get("identified")
    if window is None or row["window_start"] is None:
        return Periods(tuple(lines), whole)
    judged = window["samples"] < row["samples"]
    span = _span(backend.clock, row["window_start"], row["window_end"])
    lines.append(f"Audited window: {window['samples']:,} samples, {span}." if judged else "All of it was looked at.")
    stretch = _speaking(row, window, identified, detail)
    lines += _identified(backend.clock, stretch, window, identified)
    of_verdict = "; oscillation, Yper and band d are from what was judged"
    of_figures = whole + (of_verdict if judged or len(lines) > 2 else "")
    return Periods(tuple(lines), of_figures, _of_old(backend.clock, stretch, ends))


def _speaking(row: Mapping[str, Any], window: Any, identified: Any, detail: Mapping[str, Any]) -> list[str] | None:
    if identified is None or identified["samples"] >= window["samples"]:
        return None
    return judged_stretch([row["window_start"], row["window_end"]], detail)


def _of_old(clock: PlantClock, stretch: list[str] | None, ends: tuple[str, str] | None) -> str:
    """ "2026-11-26 12:40 to 14:19, 3.4 days before the newest sample"; empty where it is of the last day."""
    if stretch is None or ends is None:
        return ""
    age = datetime.fromisoformat(ends[1]) - datetime.fromisoformat(stretch[1])
    if age <= A_DAY:
        return ""
    return f"{clock.span(*stretch)}, {age / A_DAY:.1f} days before the newest sample"


def _identified(clock: PlantClock, stretch: list[str] | None, window: Any, identified: Any) -> list[str]:
    if identified is None or identified["samples"] >= window["samples"]:
        return []
    if stretch is None:
        return [f"The published rule was run on {identified['samples']:,} samples of it."]
    return [f"The stretch that speaks for it: {identified['samples']:,} samples, {_span(clock, *stretch)}."]


def _ends(backend: Backend, loop: LoopRow, audit_id: int) -> tuple[str, str] | None:
    """The first and the last sample of the record that was given to this run."""
    with backend.database.read() as connection:
        given = verdicts.input_of(connection, loop.id, audit_id)
    if given is None or given.input_start_ns is None or given.input_end_ns is None:
        return None
    return iso_utc(moment_of(given.input_start_ns)) or "", iso_utc(moment_of(given.input_end_ns)) or ""


def _span(clock: PlantClock, first: str, last: str) -> str:
    return f"{clock.short(first)} to {clock.short(last)}"
