"""Shelving: a loop is left out of what to look at first for a limited time, on record (the word is ISA-18.2's).

It is audited and counted as ever, and listed all the same once it is worse in kind than when it was shelved.
"""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection

from app.errors import NotFoundError, RequestError
from app.services.backend import Backend
from app.services.moments import PlantClock, iso_utc
from app.services.telling.naming import one_line
from app.services.telling.wording import UNANSWERED, VERDICT_WORDS, brief, looked_at_today, sticks_for_sure
from app.storage import notes, shelvings
from app.storage.shelvings import SaidOf, ShelvedRow

LONGEST = timedelta(days=366)
STICKS = "sticks"
WORSE_WORDS = {
    STICKS: "by now the valve sticks, and that can be relied on",
    UNANSWERED: "by now PV never answers OP: look today",
}
"""What is worse in kind than what was said when the loop was shelved."""


@dataclass(frozen=True)
class Shelved:
    """A shelved loop: until when, by whom and why, and what is said of it now. worse: what it is by now and was not
    then; empty: it is left out of the lists."""

    loop: str
    unit: str | None
    note_id: str
    shelved_at: str
    until: str
    by: str
    work_order: str
    text: str
    verdict: str | None
    reliability: str | None
    likely_cause: str | None
    worse: str

    @property
    def said(self) -> str:
        """ "valve sticks (rely on it)"."""
        if self.verdict is None:
            return "not audited"
        return f"{VERDICT_WORDS[self.verdict]} ({self.stands})"

    @property
    def stands(self) -> str:
        """What stands behind the verdict that is said of it, in two words; empty: not audited."""
        return brief(vars(self)) if self.verdict is not None else ""

    def words(self, clock: PlantClock) -> str:
        """ "shelved until 2026-10-01 06:00 (work order WO-17)", and what is worse since."""
        order = f" (work order {one_line(self.work_order)})" if self.work_order else ""
        return f"shelved until {clock.short(self.until)}{order}{f', but {self.worse}' if self.worse else ''}"


@dataclass(frozen=True)
class Shelf:
    """All loops in service that are shelved, those that are worse by now first. left_out: the ids of the others."""

    listed: list[Shelved]
    left_out: tuple[int, ...]

    def of(self, tag: str) -> Shelved | None:
        return next((one for one in self.listed if one.loop == tag), None)

    def by_tag(self) -> dict[str, Shelved]:
        return {one.loop: one for one in self.listed}

    @property
    def count_words(self) -> str:
        """ "3 shelved, 1 of them listed all the same": what stands above the folded list."""
        worse = len(self.listed) - len(self.left_out)
        return f"{len(self.listed):,} shelved" + (f", {worse:,} of them listed all the same" if worse else "")


def shelf(backend: Backend, audit_id: int | None = None, at: datetime | None = None) -> Shelf:
    """By the newest verdicts, or by those of a run, as it was `at` a time."""
    with backend.database.read() as connection:
        rows = shelvings.shelved(connection, at or datetime.now(UTC), audit_id)
    views = [_view(row) for row in rows]
    left_out = tuple(row.loop_id for row, view in zip(rows, views, strict=True) if not view.worse)
    return Shelf(sorted(views, key=lambda view: not view.worse), left_out)


def check_shelving(backend: Backend, until: datetime | None, repaired_at: datetime | None, reason: str) -> None:
    """Raises RequestError where a note cannot shelve its loop until then, in UTC (None: it does not)."""
    if until is None:
        return
    now = datetime.now(UTC)
    if not reason:
        raise RequestError("no_reason_to_shelve", "to shelve a loop takes a reason: a text or a work order")
    if repaired_at is not None:
        text = "a repair ends a shelving: write them as two notes, the repair first"
        raise RequestError("repaired_and_shelved", text)
    if not now < until <= now + LONGEST:
        told = backend.clock.told_at(until)
        text = f"a loop is shelved until a time to come, at most a year ahead, got {told}"
        raise RequestError("bad_shelving_time", text)


def kind_at(connection: Connection, loop_id: int) -> str:
    """What is wrong with the loop by its newest verdict, as a note keeps it; empty: nothing of `WORSE_WORDS`."""
    said = shelvings.newest_said(connection, loop_id)
    return "" if said is None else _kind(said)


def withdraw_shelving(backend: Backend, loop_id: int, tag: str, note_id: int, withdrawn_by: str) -> None:
    """The loop is shelved no longer; the note stays. Raises NotFoundError where it has no such note, or none that
    shelves."""
    with backend.database.write() as connection:
        note = notes.by_id(connection, loop_id, note_id)
        if note is None or note.shelved_until is None:
            raise NotFoundError("no_such_shelving", f"no note {note_id} of loop {tag!r} shelves it")
        shelvings.withdraw(connection, loop_id, note_id, withdrawn_by)


def _kind(said: ShelvedRow | SaidOf) -> str:
    row = {"verdict": said.verdict, "reliability": said.reliability, "likely_cause": said.likely_cause}
    if sticks_for_sure(row):
        return STICKS
    return UNANSWERED if looked_at_today(row) else ""


def _view(row: ShelvedRow) -> Shelved:
    kind = _kind(row)
    return Shelved(
        loop=row.tag,
        unit=row.unit,
        note_id=str(row.note_id),
        shelved_at=iso_utc(row.written_at) or "",
        until=iso_utc(row.shelved_until) or "",
        by=row.written_by,
        work_order=row.work_order,
        text=row.text,
        verdict=row.verdict,
        reliability=row.reliability,
        likely_cause=row.likely_cause,
        worse=WORSE_WORDS[kind] if kind and kind != row.shelved_as else "",
    )
