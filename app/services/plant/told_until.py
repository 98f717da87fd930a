"""Up to when what people wrote of loops belongs to a run: who works by the newest one writes as he goes, an older one
reads as its own morning knew it."""

from datetime import datetime

from sqlalchemy import Connection

from app.storage import audits, plant


def run_to_work_by(connection: Connection) -> int | None:
    """The newest night that has ended, though it was the second of its date, or a run of the plant that was asked for
    where no night began within the day before it; None: no run has ended."""
    found = plant.last_whole_run(connection)
    return None if found is None else max(found.id, audits.newest_night(connection, passes_by=True) or 0)


def notes_until(connection: Connection, audit_id: int) -> datetime | None:
    """When an older run ended; None: what is written by now counts, of this run or for want of one that is newer."""
    newest = run_to_work_by(connection)
    run = audits.by_id(connection, audit_id) if newest is not None and audit_id < newest else None
    return None if run is None else run.ended_at
