"""Retention: what is older than the settings keep it is dropped, once a night, in small batches between other work."""

import logging
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

from sqlalchemy import Connection

from app.services.access import trail
from app.services.access.identity import SCHEDULE
from app.services.auditing.nightly import latest_hour
from app.services.backend import Backend
from app.services.intake.uploads import stored_files
from app.services.moments import latest_ns
from app.services.recency import DATED_NS
from app.settings import Settings
from app.storage import retention, uploads
from app.storage import trail as trail_rows
from app.storage.types import now

BATCH = 500
BUDGET_S = 20.0
ACTION = "retention.run"
WAITS = "retention.wait"
LONGEST_PAUSE = timedelta(days=4)
"""A service that is stopped over each weekend does not wait on each Monday: that is 3 days and some hours."""
TIME_TO_SET_THE_CLOCK = timedelta(days=1)
YOUNGEST_FILE_S = 24 * 3600

Drop = Callable[[Connection], int]

log = logging.getLogger("loopaudit.upkeep")


def retain_if_due(backend: Backend, moment: datetime | None = None) -> dict[str, int] | None:
    """A part of the night's work, at most `BUDGET_S` long; None where nothing is due. The next sweep goes on."""
    moment = moment or datetime.now(UTC)
    with backend.database.read() as connection:
        last = retention.last_done(connection, ACTION)
    if last is not None and (last >= latest_hour(backend, moment) or _clock_may_be_ahead(backend, last, moment)):
        return None
    return retain(backend, BUDGET_S)


def _clock_may_be_ahead(backend: Backend, last: datetime, moment: datetime) -> bool:
    """For a day after nothing was dropped for days: the service was stopped, or its clock jumped, and what is dropped
    by a wrong clock does not come back when it is put right."""
    if moment - last < LONGEST_PAUSE:
        return False
    with backend.database.read() as connection:
        # As they were written down: by its time what a wrong clock did is ahead of all that follows.
        done, noticed = (
            trail_rows.page(connection, 1, None, who=SCHEDULE.who, action=told) for told in (ACTION, WAITS)
        )
    if not noticed or (done and noticed[0].id < done[0].id):  # another sweep may have dropped what was done
        trail.record(backend, SCHEDULE, WAITS, "", "done")
        log.warning("nothing was dropped since %s: what is old waits a day, in case that the clock is wrong", last)
        return True
    return abs(moment - noticed[0].at) < TIME_TO_SET_THE_CLOCK


def retain(backend: Backend, budget_s: float = float("inf"), batch: int = BATCH) -> dict[str, int]:
    """Drops what is old until nothing is left or the time is up, of each kind a batch at least: one that takes long
    keeps no other from being dropped. How many rows of each kind."""
    until = time.monotonic() + budget_s
    dropped: dict[str, int] = {}
    rest = False
    for kind, drop in _drops(backend, batch):
        dropped[kind], more = _drop_kind(backend, drop, until)
        rest = rest or more
    if rest:
        return dropped
    dropped["files"] = _drop_files(backend)
    trail.record(backend, SCHEDULE, ACTION, "", "done", **dropped)
    log.info("what was old is dropped", extra=dict(dropped))
    return dropped


def _drop_kind(backend: Backend, drop: Drop, until: float) -> tuple[int, bool]:
    """How many rows, and whether there may be more of them."""
    dropped = 0
    while True:
        with backend.database.write() as connection:
            retention.one_at_a_time(connection)
            count = drop(connection)
        dropped += count
        if not count or time.monotonic() >= until:
            return dropped, count > 0


def _drops(backend: Backend, batch: int) -> Iterator[tuple[str, Drop]]:
    """For each kind that is not kept for ever (0 days): how a batch of it is dropped."""
    kept = backend.settings

    def older(days: int, drop: Callable[[Connection, datetime, int], int]) -> Drop:
        return lambda connection: drop(connection, now() - timedelta(days=days), batch)

    if kept.keep_series_days:
        kept_h = max(24.0 * kept.keep_series_days, kept.window_h)  # never what the next audit would look at
        until_ns = latest_ns()
        yield "series", lambda connection: retention.drop_series(connection, kept_h, batch, until_ns, DATED_NS)
    if kept.keep_details_days:
        yield "details", older(kept.keep_details_days, retention.drop_details)
    if kept.keep_verdicts_days:
        yield "verdicts", older(kept.keep_verdicts_days, retention.drop_verdicts)
    if kept.keep_explanations_days:
        yield "explanations", older(kept.keep_explanations_days, retention.drop_explanations)
    if kept.keep_receipts_days:
        since = oldest_export(kept)
        yield "uploads", older(kept.keep_receipts_days, partial(retention.drop_uploads, exports_since=since))
    if kept.keep_trail_days:
        yield "trail", older(kept.keep_trail_days, retention.drop_trail)
    yield "sessions", lambda connection: retention.drop_sessions(connection, batch)


def _drop_files(backend: Backend) -> int:
    """Bytes of uploads that were read and last sent long ago, and bytes that no upload knows; what was found in them
    stays."""
    oldest = oldest_export(backend.settings)
    with backend.database.read() as connection:
        kept = retention.fingerprints_to_keep(connection, oldest)
    return sum(_drop_file(backend, file, oldest) for file in stored_files(backend.settings) if file.name not in kept)


def oldest_export(settings: Settings) -> datetime | None:
    """Exports that were last sent since are kept, whatever their state; None: all are."""
    days = settings.keep_uploads_days
    return now() - timedelta(days=days) if days else None


def _drop_file(backend: Backend, file: Path, oldest: datetime | None) -> bool:
    """Looks and drops under the lock under which the same bytes, sent again, are put in this place and registered."""
    if not older_than(file, YOUNGEST_FILE_S):
        return False
    with backend.database.write() as connection:
        uploads.lock_bytes(connection, file.name)
        drops = older_than(file, YOUNGEST_FILE_S) and not retention.must_keep(connection, file.name, oldest)
        if drops:
            file.unlink(missing_ok=True)
    return drops


def older_than(file: Path, seconds: float) -> bool:
    """Whether it was last written so long ago; one that somebody else took away or renamed meanwhile was not."""
    try:
        return file.stat().st_mtime < time.time() - seconds
    except FileNotFoundError:
        return False
