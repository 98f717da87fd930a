"""Whether the set points of loops move together: then that is asked first, before anything outside is looked for."""

import logging
from collections.abc import Sequence

from app.engine.plant_wide.set_points import Moves, moves_in, together
from app.nanoseconds import NS_PER_H
from app.services.backend import Backend
from app.services.moments import latest_ns
from app.storage import loops, series
from app.storage.samples import DamagedStretchError

HOURS = 24
MEMBERS = 12
"""Of so many members of a group the set points of the newest HOURS are looked at."""

log = logging.getLogger("loopaudit.groups")


def set_points_together(backend: Backend, tags: Sequence[str]) -> bool:
    """Whether the set points of at least half of these loops move at the times at which that of one of them does."""
    asked = list(tags)[:MEMBERS]
    try:
        return together([_moves_of(backend, tag) for tag in asked])
    except DamagedStretchError:
        log.exception("set points of %s cannot be read", asked)
        return False


def _moves_of(backend: Backend, tag: str) -> Moves | None:
    with backend.database.read() as connection:
        row = loops.by_tag(connection, tag)
        if row is None or row.newest_ns is None:
            return None
        end_ns = series.newest_before(connection, row.id, row.newest_ns, latest_ns())
        read = series.between(connection, row.id, end_ns - HOURS * NS_PER_H, end_ns)
    sp = None if read is None else read.signals.get("sp")
    return None if read is None or sp is None else moves_in(read.time_ns, sp)
