"""Of which time a verdict is, told in one place: how far the judged window reaches, and what came after it."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np
from sqlalchemy import Connection

from app.services.backend import Backend
from app.services.damage import damage_in_words
from app.services.moments import PlantClock, iso_utc, moment_of, ns_of
from app.services.telling.wording import codes_in
from app.storage import judged as stored
from app.storage import series
from app.storage.judged import SpanRow

LEFT_OUT = timedelta(hours=1)
"""Newer samples than what was judged are told of where they are of an hour or more."""

NOT_JUDGED = "what was recorded since was not judged"
NEWER_DISAGREES = "what was recorded since is shorter, and disagrees"

LOOKED_AT = 200
"""So many loops, the weightiest, are looked through for those that went to manual."""


@dataclass(frozen=True)
class Judged:
    """A judged window (ISO 8601, UTC) that ends well before the newest sample that the engine was given. manual:
    whether the loop is in manual, by its recorded mode, and was for most of the time since. damaged: from when to when
    (ns) what was recorded since cannot be read. disagrees: whether what was recorded since was judged too, and says
    otherwise."""

    start: str
    end: str
    manual: bool
    damaged: tuple[tuple[int, int], ...] = ()
    disagrees: bool = False

    def words(self, clock: PlantClock) -> str:
        """ "judged 2026-11-24 22:00 to 23:59; in manual since"."""
        since = "in manual since" if self.manual else NEWER_DISAGREES if self.disagrees else NOT_JUDGED
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
        rows = stored.spans(connection, tags, audit_id)
        found = {row.tag: _judged(connection, row, backend.settings.hold_days) for row in rows}
    return {tag: of for tag, of in found.items() if of is not None}


def to_manual(backend: Backend, run: int, *, and_since: bool = False) -> list[ToManual]:
    """The loops that went to manual with a run (and_since: or since then); the weightiest first."""
    with backend.database.read() as connection:
        rows = stored.no_further(connection, run, and_since, LOOKED_AT)
        newly = [row for row in rows if not _left_out(row.end_before, row.given_before)]
        told = [(row, _judged(connection, row.span, backend.settings.hold_days)) for row in newly]
    return [
        ToManual(row.span.tag, row.unit, row.verdict, row.reliability, of)
        for row, of in told
        if of is not None and of.manual
    ]


def _left_out(window_end: datetime | None, given_to_ns: int | None) -> bool:
    return window_end is not None and given_to_ns is not None and moment_of(given_to_ns) - window_end >= LEFT_OUT


def _judged(connection: Connection, row: SpanRow, hold_days: float) -> Judged | None:
    """None where all that was given was judged, but for less than is told of."""
    if row.window_end is None or row.input_end_ns is None or not _left_out(row.window_end, row.input_end_ns):
        return None
    later = series.readable(connection, row.loop_id, ns_of(row.window_end) + 1, row.input_end_ns, hold_days)
    mode = None if later.samples is None else later.samples.signals.get("automatic")
    known = np.array([]) if mode is None else mode[np.isfinite(mode)]
    manual = bool(len(known)) and float(np.mean(known == 0.0)) > 0.5 and bool(known[-1] == 0.0)
    disagrees = "newer_disagrees" in codes_in(row.reasons)
    return Judged(iso_utc(row.window_start) or "", iso_utc(row.window_end) or "", manual, later.damaged, disagrees)
