"""Loops that stopped while the others went on, told the morning after: by how far each is usually behind the others."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from statistics import median_low

from app.services.backend import Backend
from app.services.moments import iso_utc, latest_ns, moment_of, span_ns
from app.services.plant.arrivals import Arrivals, listed, nothing_new, sentences
from app.services.recency import DATED_NS, LATE
from app.services.telling.naming import NAMED
from app.storage import arrivals as stored

STOPPED = timedelta(hours=12)
"""Exports come once a day: who is farther behind than usual by half of one lacks the last one."""

RUNS = 14
SAMPLED = 51
"""So many of the loops that are up to date stand for all, in the runs before."""

LOOKED_AT = 500

Ends = Mapping[int, Mapping[int, int]]
"""By run and loop, the newest sample that it was given."""


def silences(
    backend: Backend, since_ns: int | None, audit_id: int | None = None, at: datetime | None = None
) -> list[str]:
    """Says which loops got no sample in the last export or two though at least half of the plant did, where that is
    not usual for them; of what a run was given that began `at`, or of all as it is now. Those that are behind for
    longer are told of by `arrivals`."""
    found = silent(backend, since_ns, audit_id, at)
    if not found:
        return []
    have = f"{len(found):,} loops have" if len(found) > 1 else "One loop has"
    named = listed(tuple(found[:NAMED]), len(found), backend.clock)
    return [f"{have} stopped while the others went on: no sample newer than {named}."]


def of_run(backend: Backend, audit_id: int, at: datetime, found: Arrivals) -> list[str]:
    """What is told of the records of a run that began `at`, whenever it is asked for. found: `arrivals` of what it was
    given."""
    told = sentences(found, backend.clock, "before the run")
    return [*told, *silences(backend, found.current_ns, audit_id, at), *nothing_new(backend, audit_id)]


def of_now(backend: Backend, newest_run: int | None, found: Arrivals) -> list[str]:
    """The same of all records as they are now; of what was new the newest run tells."""
    told = [*sentences(found, backend.clock), *silences(backend, found.current_ns)]
    return told if newest_run is None else [*told, *nothing_new(backend, newest_run, found)]


def silent(
    backend: Backend, since_ns: int | None, audit_id: int | None = None, at: datetime | None = None
) -> list[tuple[str, str]]:
    """Their tags and newest samples, the weightiest first."""
    until_ns = latest_ns(at)
    with backend.database.read() as connection:
        plant = stored.middle(connection, DATED_NS, until_ns, audit_id)
        if plant is None:
            return []
        first_ns = max(DATED_NS, plant - span_ns(LATE) if since_ns is None else since_ns)
        behind = stored.those_ending(connection, first_ns, plant - span_ns(STOPPED), LOOKED_AT, audit_id)
        if not behind:
            return []
        current = stored.those_ending(connection, plant, until_ns, SAMPLED, audit_id)
        ids = [row.id for row in (*behind, *current)]
        ends = stored.earlier(connection, ids, audit_id, RUNS)
    middles = _middles(ends, [row.id for row in current])
    stopped = [row for row in behind if _stopped(row.id, row.end_ns, plant, ends, middles)]
    return [(row.tag, iso_utc(moment_of(row.end_ns)) or "") for row in stopped]


def _middles(ends: Ends, current: Sequence[int]) -> dict[int, int]:
    """By run, how far the records of the loops that are up to date reached."""
    reached = {run: [given[loop] for loop in current if loop in given] for run, given in ends.items()}
    return {run: median_low(told) for run, told in reached.items() if told}


def _stopped(loop: int, end_ns: int, plant_ns: int, ends: Ends, middles: Mapping[int, int]) -> bool:
    """Whether a loop is farther behind than it ever was while its samples still came; one that is new is not."""
    lags = [
        (given[loop], middles[run] - given[loop]) for run, given in ends.items() if loop in given and run in middles
    ]
    before = [lag for end, lag in lags if end < end_ns]
    last = [lag for end, lag in lags if end == end_ns]
    usual = [*before, *([min(last)] if last else [])]
    return bool(usual) and plant_ns - end_ns > max(usual) + span_ns(STOPPED)
