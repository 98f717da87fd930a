"""What people write about a loop."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Connection, insert, select

from app.storage.tables import notes
from app.storage.types import now


@dataclass(frozen=True)
class NoteRow:
    id: int
    written_at: datetime
    written_by: str
    text: str
    work_order: str
    repaired_at: datetime | None


COLUMNS = [notes.c[name] for name in NoteRow.__dataclass_fields__]


def add(
    connection: Connection, loop_id: int, written_by: str, text: str, work_order: str, repaired_at: datetime | None
) -> int:
    values = {"text": text, "work_order": work_order, "repaired_at": repaired_at, "written_by": written_by}
    writing = insert(notes).values(loop_id=loop_id, written_at=now(), **values).returning(notes.c.id)
    return connection.scalar(writing) or 0


def of_loop(connection: Connection, loop_id: int, limit: int) -> list[NoteRow]:
    """The newest first."""
    query = select(*COLUMNS).where(notes.c.loop_id == loop_id).order_by(notes.c.id.desc()).limit(limit)
    return [NoteRow(*row) for row in connection.execute(query)]


def repair_stated_last(connection: Connection, loop_id: int) -> datetime | None:
    """Of the newest note that states one, be it earlier than another note's: so a wrong time can be put right."""
    stated = (notes.c.loop_id == loop_id) & notes.c.repaired_at.is_not(None)
    return connection.scalar(select(notes.c.repaired_at).where(stated).order_by(notes.c.id.desc()).limit(1))
