"""Whether the set points of loops move together: then that is asked first, before anything outside is looked for."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.nanoseconds import NS_PER_H, NS_PER_S
from app.services.backend import Backend
from app.storage import loops, series
from app.storage.samples import DamagedStretchError, FloatArray, TimeArray

ALIKE = 0.7
"""Correlation of how far two set points move, bin by bin, from which they move together."""

FEWEST_MOVES = 3
"""In so many bins a set point has to move: two moves at one time may be chance."""

BIN_NS = 300 * NS_PER_S
FEWEST_BINS = 12
HOURS = 24
MEMBERS = 12
"""Of so many members of a group the set points of the newest HOURS are looked at."""

log = logging.getLogger("loopaudit.groups")


@dataclass(frozen=True, eq=False)
class Moves:
    """How far a set point moves in each bin of time, the first of which is `first`."""

    first: int
    far: FloatArray


def set_points_together(backend: Backend, tags: Sequence[str]) -> bool:
    """Whether the set points of at least half of these loops move at the times at which that of one of them does."""
    asked = list(tags)[:MEMBERS]
    try:
        return together([_moves_of(backend, tag) for tag in asked])
    except DamagedStretchError:
        log.exception("set points of %s cannot be read", asked)
        return False


def together(moves: Sequence[Moves | None]) -> bool:
    moving = [one for one in moves if one is not None]
    counts = [sum(alike(one, other) for other in moving) for one in moving]
    return max(counts, default=0) >= max(2, (len(moves) + 1) // 2)


def alike(one: Moves, other: Moves) -> bool:
    """Whether two set points move at the same times, as far as both were recorded."""
    start = max(one.first, other.first)
    end = min(one.first + len(one.far), other.first + len(other.far))
    if end - start < FEWEST_BINS:
        return False
    first, second = (moves.far[start - moves.first : end - moves.first] for moves in (one, other))
    if min(np.count_nonzero(first), np.count_nonzero(second)) < FEWEST_MOVES:
        return False
    if min(np.ptp(first), np.ptp(second)) == 0.0:
        return False
    return float(np.corrcoef(first, second)[0, 1]) >= ALIKE


def moves_in(time_ns: TimeArray, sp: FloatArray) -> Moves | None:
    """None where the set point is not known, or stands."""
    known = np.isfinite(sp)
    if np.count_nonzero(known) < 2:
        return None
    bins = time_ns[known] // BIN_NS
    values = sp[known]
    size = np.ptp(values)
    if not (np.isfinite(size) and size > 0.0):
        return None
    far = np.zeros(int(bins[-1] - bins[0]) + 1)
    np.add.at(far, bins[1:] - bins[0], np.abs(np.diff(values)) / size)
    return Moves(int(bins[0]), far)


def _moves_of(backend: Backend, tag: str) -> Moves | None:
    with backend.database.read() as connection:
        row = loops.by_tag(connection, tag)
        if row is None or row.newest_ns is None:
            return None
        read = series.between(connection, row.id, row.newest_ns - HOURS * NS_PER_H, row.newest_ns)
    sp = None if read is None else read.signals.get("sp")
    return None if read is None or sp is None else moves_in(read.time_ns, sp)
