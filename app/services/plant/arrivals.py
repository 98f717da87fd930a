"""How recent the records are that verdicts rest on: a verdict of last night may be of what was recorded months ago."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from app.nanoseconds import EVER_NS
from app.services.backend import Backend
from app.services.moments import AHEAD, FIRST_DATED, PlantClock, iso_utc, latest_ns, moment_of, ns_of, span_ns
from app.services.recency import DATED_NS, LATE
from app.services.telling.naming import NAMED, named
from app.storage import arrivals as stored

NOTHING_NEW = "Nothing has been recorded since the previous run: the verdicts are from the same records."
NOTHING_NEW_THEN = (
    "Nothing was recorded between the two newest runs that ended; what has arrived since waits for the next run."
)


@dataclass(frozen=True)
class Arrivals:
    """recorded_to: the newest sample of all, ISO 8601, UTC; None where there is none. age: from it to when it was asked
    for, or to the run. behind: how many loops end two days or more before it. named: some of them, tag and newest
    sample, the weightiest first. ahead, named_ahead: the same of loops that end ahead of the clock. undated,
    named_undated: of loops whose times have no date; they count in nothing else."""

    recorded_to: str | None
    age: timedelta
    behind: int
    named: tuple[tuple[str, str], ...]
    ahead: int = 0
    named_ahead: tuple[tuple[str, str], ...] = ()
    undated: int = 0
    named_undated: tuple[tuple[str, str], ...] = ()

    @property
    def current_ns(self) -> int | None:
        """Loops that end before it are behind the others; None where there is no sample."""
        return None if self.recorded_to is None else ns_of(datetime.fromisoformat(self.recorded_to) - LATE)

    @property
    def late(self) -> bool:
        return self.recorded_to is not None and self.age >= LATE


def current_ns(backend: Backend) -> int | None:
    """`Arrivals.current_ns` of all that is stored, as it is now: of one loop's page nothing else is asked."""
    with backend.database.read() as connection:
        newest_ns = stored.newest(connection, DATED_NS, latest_ns())
    return None if newest_ns is None else newest_ns - span_ns(LATE)


def arrivals(backend: Backend, audit_id: int | None = None, at: datetime | None = None) -> Arrivals:
    """Of all that is stored, as it is now; or of what a run was given that began `at`."""
    at = at or datetime.now(UTC)
    with backend.database.read() as connection:
        newest_ns = stored.newest(connection, DATED_NS, latest_ns(at), audit_id)

        def ending(since_ns: int, before_ns: int) -> tuple[int, tuple[tuple[str, str], ...]]:
            count, ends = stored.ending(connection, since_ns, before_ns, NAMED, audit_id)
            return count, tuple((tag, iso_utc(moment_of(end_ns)) or "") for tag, end_ns in ends)

        beside = (*ending(latest_ns(at) + 1, EVER_NS), *ending(-EVER_NS, DATED_NS))
        if newest_ns is None:
            return Arrivals(None, timedelta(0), 0, (), *beside)
        behind = ending(DATED_NS, newest_ns - span_ns(LATE))
    return Arrivals(iso_utc(moment_of(newest_ns)), at - moment_of(newest_ns), *behind, *beside)


def sentences(found: Arrivals, clock: PlantClock, since: str = "ago") -> list[str]:
    """What an engineer is told of it, and of loops that are behind the others or ahead of the clock. since: to what the
    age is."""
    lines = []
    if found.recorded_to is not None:
        told = f"Recorded up to {clock.told(found.recorded_to)}"
        lines.append(f"{told}{old(found.age, since)}: no newer export has arrived." if found.late else f"{told}.")
    if found.behind:
        which = listed(found.named, found.behind, clock)
        lines.append(f"{_loops(found.behind)} no samples for two days or more before that: {which}.")
    if found.ahead:
        have = f"{found.ahead} loops have" if found.ahead > 1 else "One loop has"
        which = listed(found.named_ahead, found.ahead, clock)
        lines.append(f"{have} samples ahead of the clock, is their time zone right? {which}.")
    if found.undated:
        which = listed(found.named_undated, found.undated)
        lines.append(
            f"Without a date, because their files give no start: {which}. No other loop is compared with them."
        )
    return lines


def listed(ends: tuple[tuple[str, str], ...], count: int, clock: PlantClock | None = None) -> str:
    """Tags with their newest samples, where times are told by a clock."""
    return named([f"{tag} ({clock.short(end)})" if clock else tag for tag, end in ends], count)


def nothing_new(backend: Backend, audit_id: int, now: Arrivals | None = None) -> list[str]:
    """Says so where no loop of a run was given more than for its verdict before. now: of all that is stored, where that
    is told beside it; it may be more by now."""
    with backend.database.read() as connection:
        if stored.anything_new(connection, audit_id) or not stored.anything_given(connection, audit_id):
            return []
        given_ns = stored.newest(connection, DATED_NS, latest_ns(), audit_id)
    if now is None or now.recorded_to is None or given_ns is None:
        return [NOTHING_NEW]
    return [NOTHING_NEW_THEN if given_ns < ns_of(datetime.fromisoformat(now.recorded_to)) else NOTHING_NEW]


def newest_in_words(samples_to: str | None, clock: PlantClock) -> str:
    """Of when a loop's newest sample is; how old, where it is too old to pass over, or that it cannot be."""
    if samples_to is None:
        return ""
    moment = datetime.fromisoformat(samples_to)
    if moment < FIRST_DATED:
        return "time of day not known: its file gives no start, so 1970-01-01 stands in for it below"
    age = datetime.now(UTC) - moment
    said = ", ahead of the clock: is its time zone right?" if age < -AHEAD else old(age)
    return f"newest sample {clock.short(samples_to)}{said}"


def old(age: timedelta, since: str = "ago") -> str:
    """How old, where that is too old to pass over."""
    return f", {age.days} days {since}" if age >= LATE else ""


def _loops(count: int) -> str:
    return f"{count:,} loops got" if count > 1 else "One loop got"
