"""What became of the newest run of the plant: where a night did not run, goes on or failed in part, older verdicts look
like its own."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from app.services.auditing.audits import whole_run
from app.services.auditing.nightly import latest_hour, told
from app.services.auditing.standing_still import nobody_works
from app.services.backend import Backend
from app.services.moments import PlantClock
from app.services.outward import AuditOut
from app.storage import audits, loops, plant
from app.storage.types import CLOCK_APART

STARTED_BY = timedelta(minutes=15)
"""So long after its hour a night that has not begun is missed: workers and schedule may just be restarting."""


@dataclass(frozen=True)
class NewestRun:
    """run: of the whole plant, the one that goes on or else the newest; None: there was none. words: what became of it.
    missed: which night has not run, empty: none is missed."""

    run: AuditOut | None
    words: str
    missed: str

    @property
    def going_on(self) -> bool:
        return self.run is not None and not self.run.ended


def newest_run(backend: Backend, now: datetime | None = None) -> NewestRun:
    run = whole_run(backend)
    words = "" if run is None else _in_words(run, _any_before(backend, run), backend.clock)
    if run is not None and not run.ended and (nobody := nobody_works(backend)):
        words += f". {nobody.removesuffix('.')}"
    return NewestRun(run, words, _missed(backend, run, now or datetime.now(UTC)))


def _any_before(backend: Backend, run: AuditOut) -> bool:
    with backend.database.read() as connection:
        return plant.any_run_before(connection, int(run.id))


def _in_words(run: AuditOut, any_before: bool, clock: PlantClock) -> str:
    """run 812 of 2026-11-26 02:00 goes on, 9,100 of 14,000 loops audited; what is said of the
    others is of earlier runs."""
    name = f"run {run.id} of {clock.short(run.created_at)}"
    audited = f"{run.done:,} of {_loops(run.total)}"
    of_others = "; the verdicts of the others are from earlier runs" if any_before else ""
    if not run.ended:
        return f"{name} is still running, {audited} audited{of_others}"
    if run.cancelled:
        return f"{name} was cancelled, {audited} audited{of_others}"
    if run.failed:
        return f"{name} audited {audited}, {run.failed:,} failed{of_others}"
    return f"{name} audited {'its only loop' if run.total == 1 else f'all of its {_loops(run.total)}'}"


def _loops(count: int) -> str:
    return "1 loop" if count == 1 else f"{count:,} loops"


def _missed(backend: Backend, run: AuditOut | None, now: datetime) -> str:
    """The night whose hour has come, where neither it nor another run of the whole plant has begun since."""
    hour = latest_hour(backend, now)
    if now - hour < STARTED_BY or (run is not None and _between(hour, run.created_at, now)):
        return ""
    with backend.database.read() as connection:
        planned = audits.by_night(connection, backend.settings.plant, hour.date().isoformat())
        wanted = planned is None and loops.any_before(connection, hour)
    return f"The nightly audit of {told(hour)} has not run." if wanted else ""


def _between(hour: datetime, begun: str, now: datetime) -> bool:
    """Whether it was begun since; what a clock began that was ahead was not."""
    return hour <= datetime.fromisoformat(begun) <= now + CLOCK_APART
