"""Upkeep: the schema, the sweeper that finds lost work, and whether all is well."""

import shutil
from datetime import UTC, datetime

from sqlalchemy.exc import SQLAlchemyError

from app.errors import RequestError
from app.services.auditing import audits as audit_runs
from app.services.auditing.ending import end_if_complete
from app.services.auditing.nightly import announce_explanations, nightly_if_due
from app.services.backend import Backend, away_in_words
from app.services.digests.deliveries import announce_digests
from app.services.moments import iso_utc
from app.services.results import Readiness, SweepReport
from app.services.upkeep.retention import older_than, retain_if_due
from app.services.upkeep.tables import refuse_newer
from app.settings import Settings
from app.storage import Database, audits, explanations, items, loops, schema, uploads

LEAST_FREE_BYTES = 100 << 20
DRAFT_LIFE_S = 24 * 3600

__all__ = ["migrate", "readiness", "sweep"]


def migrate(settings: Settings) -> str:
    """Brings the data base to this version's tables; returns which version that is. Raises
    RequestError("newer_tables") where a newer loopaudit made them.
    """
    settings.prepare_folders()
    database = Database(settings.resolved_database_url)
    try:
        with away_in_words():
            refuse_newer(schema.current_revision(database))
            schema.migrate(database)
            return schema.current_revision(database) or "none"
    finally:
        database.close()


def refuse_empty(backend: Backend) -> None:
    """Raises RequestError("no_loops") where the plant has no loop with samples."""
    with backend.database.read() as connection:
        if loops.any_before(connection, datetime.now(UTC)):
            return
    settings = backend.settings
    where = backend.database.url.render_as_string() if settings.database_url else str(settings.data_dir)
    raise RequestError("no_loops", f"no loop with samples is known in {where}; is it the one of the service?")


def sweep(backend: Backend) -> SweepReport:
    """Gives the work of lost workers to others, ends runs that are complete, rings again for what nobody works on.

    May run at any time, and twice at once.
    """
    settings = backend.settings
    with backend.database.write() as connection:
        taken_back = items.reopen_expired(connection, settings.max_attempts, settings.lease_s)
        explanations.reopen_expired(connection, settings.max_attempts, settings.lease_s)
        complete = audits.complete(connection)
    ended = sum(end_if_complete(backend, audit_id) for audit_id in complete)
    with backend.database.write() as connection:
        uploads.give_up(connection, settings.max_reading_attempts, settings.lease_s)
        unread = uploads.to_announce(connection, settings.stalled_s, settings.lease_s)
        stalled = audits.to_announce(connection, settings.stalled_s)
    for upload_id in unread:
        backend.queue.read_upload(upload_id)
    for audit_id in stalled:
        audit_runs.announce(backend, audit_id)
    waiting = announce_explanations(backend) + announce_digests(backend)
    run = nightly_if_due(backend)
    retain_if_due(backend)
    _drop_old_drafts(settings)
    announced = len(unread) + len(stalled) + waiting
    return SweepReport(taken_back.reopened, taken_back.failed, ended, announced, run.id if run else None)


def readiness(backend: Backend) -> Readiness:
    """Data base, schema and disk must be well; a broker that is away only slows things down."""
    checks: dict[str, object] = {"database": _database(backend), "disk_free_bytes": _free(backend.settings)}
    checks["schema"] = "current" if checks["database"] == "ok" and _schema_is_current(backend) else "not current"
    checks["broker"] = "ok" if backend.queue.reachable() else "away"
    well = checks["database"] == "ok" and checks["schema"] == "current"
    if well:
        checks |= _waiting_for_room(backend)
    if not well or _free(backend.settings) < LEAST_FREE_BYTES:
        return Readiness("not_ready", checks)
    return Readiness("ready" if checks["broker"] == "ok" else "degraded", checks)


def _database(backend: Backend) -> str:
    try:
        backend.database.answers()
    except SQLAlchemyError as error:
        return f"away: {type(error).__name__}"
    return "ok"


def _waiting_for_room(backend: Backend) -> dict[str, object]:
    """Uploads that there is no room to read, and since when the first of them waits."""
    with backend.database.read() as connection:
        count, longest = uploads.waiting_for_room(connection)
    return {
        "uploads_waiting_for_room": count,
        "waiting_for_room_since": iso_utc(longest.waits_since if longest else None),
    }


def _schema_is_current(backend: Backend) -> bool:
    return schema.current_revision(backend.database) == schema.newest_revision()


def _free(settings: Settings) -> int:
    return shutil.disk_usage(settings.data_dir).free


def _drop_old_drafts(settings: Settings) -> None:
    """What is left of uploads that broke off with their process."""
    for draft in settings.uploads_dir.glob(".part-*"):
        if older_than(draft, DRAFT_LIFE_S):
            draft.unlink(missing_ok=True)
