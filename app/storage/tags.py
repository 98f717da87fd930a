"""Where the tags of exports belong: what somebody said for later files too, and as what they were read last."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Connection, bindparam, delete, select, update

from app.storage.bulk import among, insert_new_rows
from app.storage.locks import Lock, hold
from app.storage.tables import kept_tags, read_tags

TAGS_AT_ONCE = 5000
OTHER = "OTHER"
"""The signal of which a loop may have any number."""

Key = tuple[str, str]
"""Of a tag: `file`, the casefolded stem of its file where the tag names no loop by itself, else empty; `name`, the tag
itself, casefolded."""


@dataclass(frozen=True)
class KeptTag:
    file: str
    name: str
    tag: str
    loop: str
    signal: str
    kept_at: datetime
    kept_by: str


@dataclass(frozen=True)
class ReadTag:
    loop: str
    signal: str
    unit: str
    receipt_number: int
    newest_number: int


KEPT = [kept_tags.c[name] for name in KeptTag.__dataclass_fields__]


def keep(connection: Connection, rows: Sequence[KeptTag]) -> None:
    """In place of what was kept of these tags, and of what others were said to be that these are now."""
    lock(connection)
    own = {(row.file, row.name) for row in rows}
    given = {_place(row) for row in rows if row.signal != OTHER}
    drop(connection, [row for row in kept(connection) if (row.file, row.name) in own or _place(row) in given])
    insert_new_rows(connection, kept_tags, [vars(row) for row in rows])


def _place(row: KeptTag) -> tuple[str, str, str]:
    return row.file, row.loop.casefold(), row.signal


def kept(connection: Connection, file: str | None = None) -> list[KeptTag]:
    """All, or those that hold for a file of this casefolded stem."""
    query = select(*KEPT).order_by(kept_tags.c.loop, kept_tags.c.file, kept_tags.c.name)
    if file is not None:
        query = query.where(kept_tags.c.file.in_(["", file]))
    return [KeptTag(*row) for row in connection.execute(query)]


def drop(connection: Connection, rows: Sequence[KeptTag]) -> None:
    """These hold for no later file."""
    if rows:
        this = (kept_tags.c.file == bindparam("of_file"), kept_tags.c.name == bindparam("of_name"))
        connection.execute(delete(kept_tags).where(*this), [{"of_file": it.file, "of_name": it.name} for it in rows])


def lock(connection: Connection) -> None:
    """Of two that read or say at once what tags are, the second sees what the first one left."""
    hold(connection, Lock.TAGS)


def last_read(connection: Connection, keys: Iterable[Key]) -> dict[Key, ReadTag]:
    """As what the tags were read last; those that never were are left out."""
    names: dict[str, list[str]] = {}
    for file, name in keys:
        names.setdefault(file, []).append(name)
    columns = [read_tags.c[name] for name in ("name", *ReadTag.__dataclass_fields__)]
    found: dict[Key, ReadTag] = {}
    for file, named in names.items():
        for start in range(0, len(named), TAGS_AT_ONCE):
            some = named[start : start + TAGS_AT_ONCE]
            mine = (read_tags.c.file == file, among(connection, read_tags.c.name, some))
            for name, *place in connection.execute(select(*columns).where(*mine)):
                found[file, name] = ReadTag(*place)
    return found


def note_read(connection: Connection, new: dict[Key, ReadTag], changed: dict[Key, ReadTag]) -> None:
    if new:
        rows = [{"file": file, "name": name, **vars(it)} for (file, name), it in new.items()]
        insert_new_rows(connection, read_tags, rows)
    if changed:
        this = (read_tags.c.file == bindparam("of_file"), read_tags.c.name == bindparam("of_name"))
        told = [{"of_file": file, "of_name": name, **vars(it)} for (file, name), it in changed.items()]
        connection.execute(update(read_tags).where(*this), told)
