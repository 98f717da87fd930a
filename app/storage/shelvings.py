"""Loops that somebody took off the lists of what to look at first, until a time, with what is said of them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import Connection, ScalarSelect, and_, exists, func, select, update

from app.storage.loops import IN_SERVICE
from app.storage.newest import NEWEST_ROWS
from app.storage.notes import stands
from app.storage.tables import loops, newest_rows, notes, verdicts
from app.storage.types import now

repairs = notes.alias("repairs")
of_loop = verdicts.alias("of_loop")


class SaidOf(NamedTuple):
    verdict: str
    reliability: str
    likely_cause: str | None


@dataclass(frozen=True)
class ShelvedRow:
    """A loop in service that is shelved: by which note, what was wrong with it then, and what is said of it (None: not
    audited)."""

    loop_id: int
    tag: str
    unit: str | None
    note_id: int
    written_at: datetime
    written_by: str
    text: str
    work_order: str
    shelved_until: datetime
    shelved_as: str | None
    verdict: str | None
    reliability: str | None
    likely_cause: str | None


OF_LOOP = [loops.c.id.label("loop_id"), loops.c.tag, loops.c.unit]
_WRITTEN = ("written_at", "written_by", "text", "work_order", "shelved_until", "shelved_as")
OF_NOTE = [notes.c.id.label("note_id"), *(notes.c[name] for name in _WRITTEN)]


def shelved(connection: Connection, at: datetime, audit_id: int | None = None) -> list[ShelvedRow]:
    """The loops that are shelved `at` a time, by what was written until then, with their last verdict up to a run, be
    it of a run before; without one with their newest verdict. That which was written last counts, until a repair is
    stated after it. Those that end first come first."""
    shelves = and_(notes.c.shelved_until.is_not(None), stands(notes, at))
    last = select(func.max(notes.c.id).label("id")).where(shelves).group_by(notes.c.loop_id).subquery()
    later = (repairs.c.loop_id == notes.c.loop_id, repairs.c.id > notes.c.id, repairs.c.repaired_at.is_not(None))
    repaired = exists().where(*later, stands(repairs, at))
    said = newest_rows if audit_id is None else verdicts
    run = loops.c.newest_audit_id if audit_id is None else _last_until(audit_id)
    source = notes.join(last, last.c.id == notes.c.id).join(loops, loops.c.id == notes.c.loop_id)
    source = source.outerjoin(said, and_(said.c.loop_id == loops.c.id, said.c.audit_id == run))
    query = select(*OF_LOOP, *OF_NOTE, *(said.c[name] for name in SaidOf._fields)).select_from(source)
    query = query.where(notes.c.shelved_until > at, ~repaired, IN_SERVICE)
    return [ShelvedRow(*row) for row in connection.execute(query.order_by(notes.c.shelved_until, loops.c.tag))]


def _last_until(audit_id: int) -> ScalarSelect[Any]:
    mine = (of_loop.c.loop_id == loops.c.id, of_loop.c.audit_id <= audit_id)
    return select(func.max(of_loop.c.audit_id)).where(*mine).correlate(loops).scalar_subquery()


def newest_said(connection: Connection, loop_id: int) -> SaidOf | None:
    """Of the loop's newest verdict; None where it has none."""
    query = select(*(newest_rows.c[name] for name in SaidOf._fields)).select_from(NEWEST_ROWS)
    row = connection.execute(query.where(loops.c.id == loop_id)).one_or_none()
    return None if row is None else SaidOf._make(row)


def withdraw(connection: Connection, loop_id: int, note_id: int, withdrawn_by: str) -> None:
    """Neither this note's shelving counts any longer nor one before it, whose place it took: the loop is listed again.
    Who withdrew one first stays, and so does one that ended by itself."""
    at = now()
    mine = (notes.c.loop_id == loop_id, notes.c.id <= note_id, notes.c.shelved_until > at)
    standing = update(notes).where(*mine, notes.c.withdrawn_at.is_(None))
    connection.execute(standing.values(withdrawn_at=at, withdrawn_by=withdrawn_by))
