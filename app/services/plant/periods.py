"""Which period each figure of a verdict belongs to: the record that was given, the window, and the stretch judged."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.services.backend import Backend
from app.services.moments import PlantClock, iso_utc, moment_of
from app.services.plant.charts import judged_stretch
from app.services.plant.loops import find
from app.services.rendering import figure
from app.storage import verdicts


@dataclass(frozen=True)
class Periods:
    """lines: record, window and what was identified, each with its samples and times. of_figures: of what period the
    key figures are, which are of the whole record."""

    lines: tuple[str, ...]
    of_figures: str


def periods(backend: Backend, tag: str, row: Mapping[str, Any], detail: Mapping[str, Any]) -> Periods:
    """`row`: of the newest verdict; `detail`: what was stored beside it."""
    record = _record(backend, tag)
    between = f", {record}" if record else ""
    lines = [f"Record: {row['samples']} samples every {figure(row['sampling_interval_s'], 1)} s{between}."]
    whole = "of the whole record" + between
    window, identified = detail.get("window"), detail.get("identified")
    if window is None or row["window_start"] is None:
        return Periods(tuple(lines), whole)
    judged = window["samples"] < row["samples"]
    span = _span(backend.clock, row["window_start"], row["window_end"])
    lines.append(f"Audited window: {window['samples']} samples, {span}." if judged else "All of it was audited.")
    lines += _identified(backend.clock, row, window, identified, detail)
    of_verdict = "; oscillation, Yper and band d are of what was judged"
    return Periods(tuple(lines), whole + (of_verdict if judged or len(lines) > 2 else ""))


def _identified(
    clock: PlantClock, row: Mapping[str, Any], window: Any, identified: Any, detail: Mapping[str, Any]
) -> list[str]:
    if identified is None or identified["samples"] >= window["samples"]:
        return []
    stretch = judged_stretch([row["window_start"], row["window_end"]], detail)
    if stretch is None:
        return [f"The published rule was run on {identified['samples']} samples of it."]
    return [f"The stretch that speaks for it: {identified['samples']} samples, {_span(clock, *stretch)}."]


def _record(backend: Backend, tag: str) -> str | None:
    loop = find(backend, tag)
    with backend.database.read() as connection:
        given = verdicts.input_of(connection, loop.id, loop.newest_audit_id or 0)
    if given is None or given.input_start_ns is None:
        return None
    first, last = (iso_utc(moment_of(at)) or "" for at in (given.input_start_ns, given.input_end_ns))
    return _span(backend.clock, first, last)


def _span(clock: PlantClock, first: str, last: str) -> str:
    return f"{clock.short(first)} to {clock.short(last)}"
