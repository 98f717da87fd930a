"""What an upload brought and the database has no more: stretches that are gone, or that cannot be read."""

from collections.abc import Iterator, Sequence
from typing import Any

from sqlalchemy import Connection, delete, select

from app.storage.samples import DamagedStretchError, unpack_stored
from app.storage.tables import series

STRETCHES_AT_ONCE = 64


def has_stretches(connection: Connection, upload_id: int) -> bool:
    return connection.scalar(select(series.c.id).where(series.c.upload_id == upload_id).limit(1)) is not None


def damaged_of(connection: Connection, upload_id: int) -> list[int]:
    """Stretches of the upload that cannot be read; each of them is unpacked."""
    return [row.id for row in _stretches_of(connection, upload_id) if _is_damaged(row)]


def drop_stretches(connection: Connection, stretch_ids: Sequence[int]) -> None:
    for first in range(0, len(stretch_ids), STRETCHES_AT_ONCE):
        some = stretch_ids[first : first + STRETCHES_AT_ONCE]
        connection.execute(delete(series).where(series.c.id.in_(some)))


def _stretches_of(connection: Connection, upload_id: int) -> Iterator[Any]:
    """A few at a time: a plant's day has hundreds of megabytes."""
    query = select(series.c.id, series.c.packed).where(series.c.upload_id == upload_id).order_by(series.c.id)
    after = 0
    while rows := connection.execute(query.where(series.c.id > after).limit(STRETCHES_AT_ONCE)).all():
        yield from rows
        after = rows[-1].id


def _is_damaged(row: Any) -> bool:
    try:
        unpack_stored(row.id, row.packed)
    except DamagedStretchError:
        return True
    return False
