"""Notes, work orders and repairs, as they are stated of a loop and taken back."""

from datetime import UTC, datetime, timedelta

from app.errors import NotFoundError, RequestError
from app.services.backend import Backend
from app.services.cursors import decode, identifier, page_of
from app.services.loops import OneLoop, find
from app.services.moments import iso_utc
from app.services.outward import NoteOut
from app.services.results import Page
from app.services.stating.shelving import check_shelving, kind_at, withdraw_shelving
from app.services.telling.naming import without_commands
from app.storage import notes
from app.storage.notes import NoteRow

LONGEST_TEXT = 4000
LONGEST_WORK_ORDER = 100
SHOWN = 50
CLOCKS_DIFFER = timedelta(minutes=5)
"""A repair may be ahead of our clock by so much: the clock of who writes it may be fast."""


def add_note(
    backend: Backend,
    tag: str,
    text: str,
    work_order: str = "",
    repaired_at: datetime | None = None,
    written_by: str = "",
    shelved_until: datetime | None = None,
) -> NoteOut:
    """Raises RequestError where nothing is said, too much, a repair that is still to come, or a shelving that cannot
    be."""
    # Forms send two characters for the end of a line, where whoever types counts one.
    text, work_order = without_commands(text).replace("\r\n", "\n").strip(), without_commands(work_order).strip()
    if not text and not work_order and repaired_at is None and shelved_until is None:
        raise RequestError("empty_note", "a note needs a text, a work order or the time of a repair")
    if len(text) > LONGEST_TEXT or len(work_order) > LONGEST_WORK_ORDER:
        most = f"{LONGEST_TEXT} characters, a work order {LONGEST_WORK_ORDER}"
        raise RequestError("note_too_long", f"a note may have at most {most}")
    repaired_at = None if repaired_at is None else _in_utc(repaired_at)
    if repaired_at is not None and repaired_at > datetime.now(UTC) + CLOCKS_DIFFER:
        told = backend.clock.told_at(repaired_at)
        raise RequestError("bad_repair_time", f"{told} is still to come; a repair is written down once it is done")
    shelved_until = None if shelved_until is None else _in_utc(shelved_until)
    check_shelving(backend, shelved_until, repaired_at, text or work_order)
    row = find(backend, tag)
    with backend.database.write() as connection:
        shelved_as = None if shelved_until is None else kind_at(connection, row.id)
        said = (written_by, text, work_order, repaired_at, shelved_until, shelved_as)
        note_id = notes.add(connection, row.id, *said)
        return _view(notes.by_id(connection, row.id, note_id))


def withdraw_repair(backend: Backend, tag: str, note_id: str, withdrawn_by: str = "") -> NoteOut:
    """The repair that a note states counts no longer; the note stays, and the repair stated before counts again.

    Withdrawn once more, nothing changes. Raises NotFoundError where the loop has no such note, or it states none.
    """
    row = find(backend, tag)
    key = identifier(note_id)
    with backend.database.write() as connection:
        note = notes.by_id(connection, row.id, key)
        if note is None or note.repaired_at is None:
            raise NotFoundError("no_such_repair", f"no note {note_id[:40]!r} of loop {tag!r} states a repair")
        notes.withdraw(connection, key, withdrawn_by)
        return _view(notes.by_id(connection, row.id, key))


def end_shelving(backend: Backend, tag: str, note_id: str, withdrawn_by: str = "") -> NoteOut:
    """The loop is shelved no longer, by this note or one before it; what was written stays.

    Withdrawn once more, nothing changes. Raises NotFoundError where the loop has no such note, or it does not shelve.
    """
    row = find(backend, tag)
    key = identifier(note_id)
    withdraw_shelving(backend, row.id, tag, key, withdrawn_by)
    with backend.database.read() as connection:
        return _view(notes.by_id(connection, row.id, key))


def list_notes(backend: Backend, loop: OneLoop) -> list[NoteOut]:
    """The newest `SHOWN`, the newest first."""
    return note_page(backend, loop, SHOWN).rows


def note_page(backend: Backend, loop: OneLoop, limit: int = 100, cursor: str | None = None) -> Page[NoteOut]:
    """The newest first."""
    row, before = find(backend, loop), decode(cursor, (int,))
    with backend.database.read() as connection:
        found = notes.of_loop(connection, row.id, limit + 1, before[0] if before else None)
    return page_of(found, limit, _view, lambda note: (note.id,))


def _in_utc(moment: datetime) -> datetime:
    """Without an offset it is UTC, as all times of the API are."""
    try:
        return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    except OverflowError:
        raise RequestError("bad_time", f"{moment} is beyond the years that there are") from None


def _view(note: NoteRow | None) -> NoteOut:
    if note is None:
        raise RuntimeError("a note that was there in this transaction is gone")
    return NoteOut(
        id=str(note.id),
        written_at=iso_utc(note.written_at) or "",
        written_by=note.written_by,
        text=note.text,
        work_order=note.work_order,
        repaired_at=iso_utc(note.repaired_at),
        shelved_until=iso_utc(note.shelved_until),
        withdrawn_at=iso_utc(note.withdrawn_at),
        withdrawn_by=note.withdrawn_by or None,
        written_of=note.written_of,
    )
