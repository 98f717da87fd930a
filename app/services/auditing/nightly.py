"""The nightly audit of the whole plant: once a date, at its hour, or later that day where the hour was missed."""

from datetime import UTC, date, datetime, timedelta
from zoneinfo import ZoneInfo

from app.services.access import trail
from app.services.access.identity import SCHEDULE
from app.services.auditing.audits import start_audit
from app.services.backend import Backend
from app.services.results import AuditView
from app.storage import audits, explanations, loops


def nightly(backend: Backend, day: date | None = None, started_by: str = SCHEDULE.who) -> AuditView:
    """The run of the night `day` (today in the plant's zone): planned now, or the one that was planned before."""
    day = day or datetime.now(ZoneInfo(backend.settings.time_zone)).date()
    return start_audit(backend, trigger="nightly", nightly_for=day.isoformat(), started_by=started_by)


def nightly_if_due(backend: Backend, now: datetime | None = None) -> AuditView | None:
    """Starts the night's run where its hour has come and nobody has started it yet.

    A plant whose first samples came after the hour waits for the next night.
    """
    hour = latest_hour(backend, now or datetime.now(UTC))
    with backend.database.read() as connection:
        planned = audits.by_night(connection, backend.settings.plant, hour.date().isoformat())
        if planned is not None or not loops.any_before(connection, hour):
            return None
    run = nightly(backend, hour.date())
    trail.record(backend, SCHEDULE, "audit.start", f"/v1/audits/{run.id}", "done")
    return run


def announce_explanations(backend: Backend) -> int:
    """Asks for the explanations of the night's worst loops once its run has ended, and rings for all that wait."""
    with backend.database.write() as connection:
        run = explanations.newest_nightly(connection)
        if run is not None and backend.settings.nightly_explanations:
            explanations.plan_for_run(connection, run, backend.settings.nightly_explanations)
        waiting = len(explanations.to_announce(connection, backend.settings.stalled_s))
    backend.queue.explain(min(waiting, backend.settings.fan_out))
    return waiting


def latest_hour(backend: Backend, now: datetime) -> datetime:
    """The last time before `now` that the clock at the plant showed the hour of the nightly audit."""
    zone, at = ZoneInfo(backend.settings.time_zone), backend.settings.nightly_at
    local = now.astimezone(zone)
    today = datetime.combine(local.date(), at, zone)
    return today if today <= local else datetime.combine(local.date() - timedelta(days=1), at, zone)
