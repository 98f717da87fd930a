"""Of which time a verdict is, told in one place: how far the judged window reaches, and what came after it."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from sqlalchemy import Connection

from app.services.backend import Backend
from app.services.damage import damage_in_words
from app.services.moments import PlantClock, iso_utc, moment_of, ns_of
from app.storage import judged as stored
from app.storage import series

LEFT_OUT = timedelta(hours=1)
"""Newer samples than what was judged are told of where they are of an hour or more."""

LOOKED_AT = 200
"""So many loops, the weightiest, are looked through for those that went to manual."""


@dataclass(frozen=True)
class Judged:
    """A judged window (ISO 8601, UTC) that ends well before the newest sample that the engine was given. manual:
    whether the loop was in manual for most of the time since, by its recorded mode. damaged: from when to when (ns)
    what was recorded since cannot be read."""

    start: str
    end: str
    manual: bool
    damaged: tuple[tuple[int, int], ...] = ()

    def words(self, clock: PlantClock) -> str:
        """ "judged 2026-11-24 22:00 to 23:59; in manual since"."""
        since = "in manual since" if self.manual else "what was recorded since cannot be judged"
        damage = damage_in_words(self.damaged, clock).removesuffix(".")
        return f"judged {clock.span(self.start, self.end)}; {since}{f'. {damage}' if damage else ''}"


@dataclass(frozen=True)
class ToManual:
    """A loop that went to manual: its verdict is still the one of before."""

    loop: str
    unit: str | None
    verdict: str
    reliability: str
    judged: Judged


def judged(backend: Backend, tags: Sequence[str], audit_id: int | None = None) -> dict[str, Judged]:
    """Of the loops whose newest verdict (or that of a run) is of a time that is well before their newest samples."""
    with backend.database.read() as connection:
        late = [row for row in stored.spans(connection, tags, audit_id) if _left_out(row.window_end, row.input_end_ns)]
        return {row.tag: _judged(connection, row, backend.settings.hold_days) for row in late}


def to_manual(backend: Backend, run: int, *, and_since: bool = False) -> list[ToManual]:
    """The loops that went to manual with a run (and_since: or since then); the weightiest first."""
    with backend.database.read() as connection:
        rows = [row for row in stored.no_further(connection, run, and_since, LOOKED_AT) if _newly(row)]
        told = [(row, _judged(connection, row, backend.settings.hold_days)) for row in rows]
    return [ToManual(row.tag, row.unit, row.verdict, row.reliability, of) for row, of in told if of.manual]


def _newly(row: Any) -> bool:
    return _left_out(row.window_end, row.input_end_ns) and not _left_out(row.end_before, row.given_before)


def _left_out(window_end: datetime | None, given_to_ns: int | None) -> bool:
    return window_end is not None and given_to_ns is not None and moment_of(given_to_ns) - window_end >= LEFT_OUT


def _judged(connection: Connection, row: Any, hold_days: float) -> Judged:
    later = series.readable(connection, row.loop_id, ns_of(row.window_end) + 1, row.input_end_ns, hold_days)
    mode = None if later.samples is None else later.samples.signals.get("automatic")
    known = np.array([]) if mode is None else mode[np.isfinite(mode)]
    manual = bool(len(known)) and float(np.mean(known)) < 0.5
    return Judged(iso_utc(row.window_start) or "", iso_utc(row.window_end) or "", manual, later.damaged)
