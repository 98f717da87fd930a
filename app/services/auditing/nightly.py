"""The nightly audit of the whole plant: once a date, at its hour, or later that day where the hour was missed."""

import logging
from datetime import UTC, date, datetime, timedelta
from zoneinfo import ZoneInfo

from app.errors import RequestError
from app.services.access import trail
from app.services.access.identity import SCHEDULE
from app.services.auditing.audits import Started, plan_audit
from app.services.backend import Backend
from app.services.outward import AuditOut
from app.settings import Settings
from app.storage import audits, explanations, loops
from app.storage import trail as trail_rows
from app.storage.types import CLOCK_APART
from app.storage.types import now as stored_now

AHEAD = "audit.ahead"
MOST_NIGHTS_TOLD = 100

log = logging.getLogger("loopaudit.nightly")


def nightly(backend: Backend, day: date | None = None, started_by: str = SCHEDULE.who) -> AuditOut:
    """The run of the night `day` (today in the plant's zone): planned now, or the one that was planned before.

    Before the hour it is that date's night too, and the schedule then plans none: whoever asks by hand or from cron
    wants one night, not two.
    """
    return _plan(backend, day or datetime.now(ZoneInfo(backend.settings.time_zone)).date(), started_by).run


def _plan(backend: Backend, day: date, started_by: str) -> Started:
    return plan_audit(backend, trigger="nightly", nightly_for=day.isoformat(), started_by=started_by)


def refuse_empty(backend: Backend) -> None:
    """Raises RequestError("no_loops") where the plant has no loop with samples."""
    with backend.database.read() as connection:
        if loops.any_before(connection, datetime.now(UTC)):
            return
    settings = backend.settings
    where = backend.database.url.render_as_string() if settings.database_url else str(settings.data_dir)
    raise RequestError("no_loops", f"no loop with samples is known in {where}; is it the one of the service?")


def nightly_if_due(backend: Backend, now: datetime | None = None) -> AuditOut | None:
    """Starts the night's run where its hour has come and nobody has started it yet.

    A plant whose first samples came after the hour waits for the next night, and a night whose run somebody asked for
    before the hour has none of the schedule's: both are told once. A night that a clock had begun that was
    ahead comes all the same.
    """
    now = now or datetime.now(UTC)
    hour = latest_hour(backend, now)
    night = hour.date().isoformat()
    _let_go_of_nights_ahead(backend, night)
    with backend.database.read() as connection:
        planned = audits.by_night(connection, backend.settings.plant, night)
        due = planned is None and loops.any_before(connection, hour)
        too_late = planned is None and not due and loops.any_before(connection, now)
    if due:
        begun = _plan(backend, hour.date(), SCHEDULE.who)
        if begun.anew:  # else another sweep was quicker, and tells it
            trail.record(backend, SCHEDULE, "audit.start", f"/v1/audits/{begun.run.id}", "done")
            log.info("nightly audit of %s started, run %s", night, begun.run.id)
        return begun.run
    if planned is not None and planned.created_at < hour and planned.started_by != SCHEDULE.who:
        text = f"no nightly audit at {told(hour)}: run {planned.id} of that date was started before, by"
        _tell_once(backend, "audit.skip", f"/v1/audits/{planned.id}", f"{text} {planned.started_by or 'somebody'}")
    elif too_late:
        text = f"no nightly audit of {night}: the first samples came after its hour; the next one is at"
        _tell_once(backend, "audit.wait", f"night {night}", f"{text} {told(next_hour(backend.settings, now))}")
    return None


def _let_go_of_nights_ahead(backend: Backend, night: str) -> None:
    """As soon as the clock is right again: at the hour itself a run that began at that hour looks like any other.

    Once a night: of two servers whose clocks differ, the one would begin anew what the other lets go, for ever.
    """
    with backend.database.read() as connection:
        ahead = audits.nights_dated_after(connection, backend.settings.plant, night, stored_now() + CLOCK_APART)
        told = trail_rows.page(connection, MOST_NIGHTS_TOLD, None, who=SCHEDULE.who, action=AHEAD) if ahead else []
    for run in ahead:
        subject = f"night {run.nightly_for}"
        if subject in {row.subject for row in told}:
            continue
        with backend.database.write() as connection:
            audits.let_go_of_night(connection, run.id)
        trail.record(backend, SCHEDULE, AHEAD, subject, "done")
        log.warning("run %s was begun by a clock that was ahead; the %s comes at its hour", run.id, subject)


def _tell_once(backend: Backend, action: str, subject: str, text: str) -> None:
    """In the log, and in the trail, which knows for all processes what was told."""
    with backend.database.read() as connection:
        newest = trail_rows.page(connection, 1, None, who=SCHEDULE.who, action=action)
    if not newest or newest[0].subject != subject:
        trail.record(backend, SCHEDULE, action, subject, "done")
        log.info(text)


def announce_explanations(backend: Backend) -> int:
    """Asks for the explanations of the night's worst loops once its run has ended, and rings for all that wait."""
    with backend.database.write() as connection:
        run = audits.newest_night(connection)
        if run is not None and backend.settings.nightly_explanations:
            explanations.plan_for_run(connection, run, backend.settings.nightly_explanations)
        waiting = len(explanations.to_announce(connection, backend.settings.stalled_s))
    backend.queue.explain(min(waiting, backend.settings.fan_out))
    return waiting


def latest_hour(backend: Backend, now: datetime) -> datetime:
    """The last time before `now` that the clock at the plant showed the hour of the nightly audit."""
    return max((hour for hour in _hours(backend.settings, now) if _has_come(hour, now)), key=_in_utc)


def next_hour(settings: Settings, now: datetime) -> datetime:
    """The first time after `now` that the clock at the plant shows the hour of the nightly audit."""
    return min((hour for hour in _hours(settings, now) if not _has_come(hour, now)), key=_in_utc)


def _hours(settings: Settings, now: datetime) -> list[datetime]:
    """Those of the days around the one that it is at the plant. Where the clock skips the end of a day, as in Nuuk, the
    hour of yesterday may come today."""
    zone = ZoneInfo(settings.time_zone)
    today = now.astimezone(zone).date()
    return [datetime.combine(today + timedelta(days=days), settings.nightly_at, zone) for days in (-2, -1, 0, 1)]


def _has_come(hour: datetime, now: datetime) -> bool:
    # In UTC: two times of one zone compare by what its clock shows, and once a year it shows an hour twice.
    return _in_utc(hour) <= _in_utc(now)


def _in_utc(moment: datetime) -> datetime:
    return moment.astimezone(UTC)


def told(hour: datetime) -> str:
    """2026-11-26 02:00 Europe/Berlin."""
    return f"{hour:%Y-%m-%d %H:%M} {hour.tzinfo}"
