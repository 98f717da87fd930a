"""Audit runs: planned for the loops of a filter, worked off in chunks, ended when no loop is left."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import Connection

from app.counting import counted
from app.engine.audit_config import AuditConfig
from app.errors import NotFoundError, RequestError
from app.services.auditing import ending
from app.services.backend import Backend
from app.services.cursors import decode, identifier, page_of
from app.services.moments import iso_utc, latest_ns
from app.services.outward import AuditOut, FailureOut
from app.services.recency import DATED_NS
from app.services.results import Page
from app.services.telling.naming import named
from app.storage import arrivals, audits, items, loops
from app.storage.audits import AuditRow, LoopFilter, Progress

LISTED_FAILURES = 100
MOST_OPEN = 100_000
"""Loops that may wait when one more run is asked for: some runs of a large plant."""

NO_LOOPS = "no_loops"
NOTHING_THERE = "no loop with samples was known when it began; send an export, and start a run once it is read"

__all__ = [
    "LoopFilter",
    "cancel_audit",
    "failures",
    "get_audit",
    "list_audits",
    "plan_audit",
    "start_audit",
    "whole_run",
]


@dataclass(frozen=True)
class Started:
    """A run, and whether it was planned now: of two who ask for the same night one has planned it."""

    run: AuditOut
    anew: bool


def start_audit(
    backend: Backend,
    wanted: LoopFilter | None = None,
    *,
    trigger: str = "request",
    started_by: str = "",
    unless_going_on: bool = False,
) -> AuditOut:
    """The run of `plan_audit`, whoever planned it; of no night."""
    return plan_audit(backend, wanted, trigger=trigger, started_by=started_by, unless_going_on=unless_going_on).run


def plan_audit(
    backend: Backend,
    wanted: LoopFilter | None = None,
    *,
    trigger: str = "request",
    nightly_for: str | None = None,
    started_by: str = "",
    unless_going_on: bool = False,
) -> Started:
    """Plans a run over the loops with samples that fit the filter, and wakes the workers.

    The run of a night (`nightly_for`, a date) is planned once; asked for again, it is that run. unless_going_on: while
    a run of the whole plant goes on, and nothing has come since it began, it is that one. Raises RequestError
    ("too_many_open") where somebody asks and far more loops wait than any plant has, ("unknown_loops") where a named
    tag is not there, ("no_loops") where a filter leaves no loop with samples. Of a plant without any the run ends at
    once and says so.
    """
    wanted = _spelled(backend, wanted or LoopFilter())
    settings, config = backend.settings, AuditConfig()
    values: dict[str, Any] = {
        "trigger": trigger,
        "plant": settings.plant,
        "nightly_for": nightly_for,
        "started_by": started_by,
        "filter_json": json.dumps(vars(wanted)),
        "config_json": config.canonical_json(),
        "config_fingerprint": config.fingerprint(),
        "window_h": settings.window_h,
        "window_samples": settings.window_samples,
    }
    with backend.database.write() as connection:
        going_on = audits.whole_going_on(connection) if unless_going_on else None
        if going_on is not None:
            return Started(_seen(connection, str(going_on)), anew=False)
        if trigger == "request":
            _refuse_flood(connection)
        values["newest_ns"] = arrivals.newest(connection, DATED_NS, latest_ns())
        audit_id = audits.plan(connection, values, wanted)
        _refuse_none(connection, audit_id, wanted)
        night = None if audit_id is not None else audits.by_night(connection, settings.plant, nightly_for or "")
        if audit_id is not None:
            audits.note_announced(connection, audit_id)
        # Read here: nothing may fail once the run stands, or whoever asked for it would ask again and have two.
        run = _seen(connection, str(audit_id or (night.id if night else 0)))
    if audit_id is not None:
        _ring(backend, audit_id, run.open)
    return Started(run, anew=audit_id is not None)


def announce(backend: Backend, audit_id: int) -> None:
    """Rings again for a run that nobody works on, or in which a worker could call no successor."""
    with backend.database.write() as connection:
        left = audits.progress(connection, [audit_id])[audit_id].open
        audits.note_announced(connection, audit_id)
    _ring(backend, audit_id, left)


def _ring(backend: Backend, audit_id: int, left: int) -> None:
    """As many messages as there are chunks left, up to the fan-out; each goes on while there is something to do."""
    chunks = math.ceil(left / backend.settings.chunk_loops)
    backend.queue.audit_chunks(audit_id, min(chunks, backend.settings.fan_out))


def get_audit(backend: Backend, audit_id: str) -> AuditOut:
    with backend.database.read() as connection:
        return _seen(connection, audit_id)


def whole_run(backend: Backend) -> AuditOut | None:
    """The run of the whole plant that goes on, or else the newest one, without its failures."""
    with backend.database.read() as connection:
        row = audits.newest_whole(connection)
        return None if row is None else _view(row, audits.progress(connection, [row.id])[row.id], [])


def list_audits(backend: Backend, limit: int = 50, cursor: str | None = None) -> Page[AuditOut]:
    """Runs, the newest first, without their failures."""
    before = decode(cursor, (int,))
    with backend.database.read() as connection:
        rows = audits.page(connection, limit + 1, before[0] if before else None)
        progress = audits.progress(connection, [row.id for row in rows[:limit]])
    return page_of(rows, limit, lambda row: _view(row, progress[row.id], []), lambda row: (row.id,))


def failures(backend: Backend, audit_id: str, limit: int = 20_000) -> list[FailureOut]:
    """Without loops that were called off with their run."""
    with backend.database.read() as connection:
        found = items.failures(connection, identifier(audit_id), limit)
    return [FailureOut(f.tag, f.code, f.text) for f in found if f.code != items.CANCELLED]


def cancel_audit(backend: Backend, audit_id: str) -> AuditOut:
    """Stops a run: its loops that are not done become failed(cancelled), and what was found stays. Cancelled again, it
    is that run. Raises RequestError("wrong_state") where it has ended in another way."""
    run = get_audit(backend, audit_id)
    if not run.ended:
        ending.cancel(backend, int(run.id))
        run = get_audit(backend, audit_id)
    if run.state != "cancelled":
        raise RequestError("wrong_state", f"run {run.id} has ended and is {run.state}; nothing is left to be cancelled")
    return run


def _spelled(backend: Backend, wanted: LoopFilter) -> LoopFilter:
    """With the tags as their loops have them."""
    if wanted.tags is None:
        return wanted
    with backend.database.read() as connection:
        known = loops.as_spelled(connection, wanted.tags)
    missing = [tag for tag in wanted.tags if tag not in known]
    if missing:
        shown = ", ".join(repr(tag) for tag in missing[:5])
        raise RequestError(
            "unknown_loops",
            f"{len(missing):,} of {counted(len(wanted.tags), 'tag')} {'is' if len(missing) == 1 else 'are'} not there: "
            f"{shown}",
        )
    return replace(wanted, tags=tuple(dict.fromkeys(known[tag] for tag in wanted.tags)))


def _refuse_flood(connection: Connection) -> None:
    if items.count_open(connection, MOST_OPEN) >= MOST_OPEN:
        text = f"{MOST_OPEN:,} loops and more wait for their audits; wait for the runs that go on, or cancel some"
        raise RequestError("too_many_open", text)


def _refuse_none(connection: Connection, audit_id: int | None, wanted: LoopFilter) -> None:
    planned = None if audit_id is None else audits.by_id(connection, audit_id)
    if planned is not None and planned.total == 0 and wanted != LoopFilter():
        named = ", ".join(f"{name} {_short(value)}" for name, value in vars(wanted).items() if value is not None)
        in_service = " and in service" if wanted.tags is None else ""
        raise RequestError(NO_LOOPS, f"no loop with samples{in_service} has {named}")


def _short(value: str | tuple[str, ...]) -> str:
    return repr(value) if isinstance(value, str) else ", ".join(map(repr, value[:5])) or "none"


def _seen(connection: Connection, audit_id: str) -> AuditOut:
    row = audits.by_id(connection, identifier(audit_id))
    if row is None:
        raise NotFoundError("unknown_audit", f"there is no audit {audit_id!r}")
    progress = audits.progress(connection, [row.id])[row.id]
    failed = items.failures(connection, row.id, LISTED_FAILURES) if progress.failed + progress.cancelled else []
    return _view(row, progress, [FailureOut(f.tag, f.code, f.text) for f in failed])


def _view(row: AuditRow, progress: Progress, failed: list[FailureOut]) -> AuditOut:
    return AuditOut(
        id=str(row.id),
        state=row.state,  # type: ignore[arg-type]  # the table allows no other
        trigger=row.trigger,
        created_at=iso_utc(row.created_at) or "",
        ended_at=iso_utc(row.ended_at),
        total=row.total,
        open=progress.open + progress.claimed,
        done=progress.done,
        failed=progress.failed + progress.cancelled,
        cancelled=progress.cancelled,
        failures=failed,
        started_by=row.started_by or None,
        night=row.nightly_for,
        part=_part(json.loads(row.filter_json)),
        code=None if row.total else NO_LOOPS,
        text=None if row.total else NOTHING_THERE,
    )


def _part(wanted: Mapping[str, Any]) -> str:
    """Which part of the plant a run was asked for."""
    told = [f"{name} {wanted[name]}" for name in ("unit", "type") if wanted.get(name) is not None]
    tags = wanted.get("tags")
    told += [f"{'loop' if len(tags) == 1 else 'loops'} {named(tags)}"] if tags is not None else []
    return ", ".join(told) or "the whole plant"
