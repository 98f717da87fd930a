"""What people write about a loop."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import ColumnElement, Connection, FromClause, and_, exists, func, insert, or_, select, true, update

from app.storage.bulk import among, among_many
from app.storage.tables import loops, notes
from app.storage.types import now


@dataclass(frozen=True)
class NoteRow:
    id: int
    written_at: datetime
    written_by: str
    text: str
    work_order: str
    repaired_at: datetime | None
    shelved_until: datetime | None
    withdrawn_at: datetime | None
    withdrawn_by: str
    written_of: str | None


COLUMNS = [notes.c[name] for name in NoteRow.__dataclass_fields__]


def add(
    connection: Connection,
    loop_id: int,
    written_by: str,
    text: str,
    work_order: str,
    repaired_at: datetime | None,
    shelved_until: datetime | None = None,
    shelved_as: str | None = None,
) -> int:
    values = {"text": text, "work_order": work_order, "repaired_at": repaired_at, "written_by": written_by}
    values |= {"shelved_until": shelved_until, "shelved_as": shelved_as}
    writing = insert(notes).values(loop_id=loop_id, written_at=now(), **values).returning(notes.c.id)
    return connection.scalar(writing) or 0


def of_loop(connection: Connection, loop_id: int, limit: int, before_id: int | None = None) -> list[NoteRow]:
    """The newest first."""
    query = select(*COLUMNS).where(notes.c.loop_id == loop_id).order_by(notes.c.id.desc()).limit(limit)
    if before_id is not None:
        query = query.where(notes.c.id < before_id)
    return [NoteRow(*row) for row in connection.execute(query)]


def by_id(connection: Connection, loop_id: int, note_id: int) -> NoteRow | None:
    """The note, where it is of this loop."""
    mine = (notes.c.loop_id == loop_id, notes.c.id == note_id)
    row = connection.execute(select(*COLUMNS).where(*mine)).one_or_none()
    return None if row is None else NoteRow(*row)


def stands(table: FromClause, at: datetime | None = None) -> ColumnElement[bool]:
    """Of `notes` or an alias of them: written until then, and not withdrawn by then; None: up to now."""
    withdrawn = table.c.withdrawn_at
    kept = withdrawn.is_(None) if at is None else or_(withdrawn.is_(None), withdrawn > at)
    return and_(_written(table, at), kept)


def _written(table: FromClause, at: datetime | None) -> ColumnElement[bool]:
    return true() if at is None else table.c.written_at <= at


def withdraw(connection: Connection, note_id: int, withdrawn_by: str) -> None:
    """The note's repair counts no longer; who withdrew it first stays."""
    standing = (notes.c.id == note_id, notes.c.withdrawn_at.is_(None))
    connection.execute(update(notes).where(*standing).values(withdrawn_at=now(), withdrawn_by=withdrawn_by))


@dataclass(frozen=True)
class Standing:
    """What is written of a loop and stands: the newest work order, the repair that was stated last, and the order that
    was written with it or before it."""

    work_order: str | None = None
    repaired_at: datetime | None = None
    repair_order: str | None = None


def standing(connection: Connection, tags: Iterable[str], at: datetime | None = None) -> dict[str, Standing]:
    """By tag, of the loops of which there is something. at: what was written until then, and not withdrawn by then;
    None: up to now."""
    query = select(loops.c.tag, notes.c.work_order, notes.c.repaired_at, stands(notes, at).label("stands"))
    said = or_(notes.c.work_order != "", notes.c.repaired_at.is_not(None))
    query = query.join(loops, loops.c.id == notes.c.loop_id).where(said, among_many(connection, loops.c.tag, tags))
    found: dict[str, Standing] = {}
    # An order that was written with a repair that was withdrawn is an order all the same.
    for tag, work_order, repaired_at, counts in connection.execute(
        query.where(_written(notes, at)).order_by(notes.c.id)
    ):
        before = found.get(tag, Standing())
        order = work_order or before.work_order
        repair = (repaired_at, order) if repaired_at and counts else (before.repaired_at, before.repair_order)
        found[tag] = Standing(order, *repair)
    return {tag: one for tag, one in found.items() if one != Standing()}


def has_open_order() -> ColumnElement[bool]:
    """Of a loop: a work order was written, and no repair that stands was stated with it or after it."""
    order, repair = notes.alias("order_note"), notes.alias("repair_note")
    repaired = (repair.c.loop_id == loops.c.id, repair.c.repaired_at.is_not(None), stands(repair))
    last_repair = select(func.max(repair.c.id)).where(*repaired).correlate(loops).scalar_subquery()
    written = (order.c.loop_id == loops.c.id, order.c.work_order != "", order.c.id > func.coalesce(last_repair, 0))
    return exists().where(*written).correlate(loops)


def repairs_stated_last(connection: Connection, loop_ids: Iterable[int]) -> dict[int, datetime]:
    """By loop, of the newest note that states a repair that stands, be it earlier than another note's: so a wrong time
    can be put right."""
    standing = and_(notes.c.repaired_at.is_not(None), stands(notes))
    of_these = among(connection, notes.c.loop_id, loop_ids)
    query = select(notes.c.loop_id, notes.c.repaired_at).where(of_these, standing)
    return {row.loop_id: row.repaired_at for row in connection.execute(query.order_by(notes.c.id))}
