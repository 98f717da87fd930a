"""Stored samples damaged on purpose."""

from sqlalchemy import select, update

from app.services.backend import Backend
from app.storage import loops
from app.storage.tables import series


def loop_id_of(backend: Backend, tag: str) -> int:
    with backend.database.read() as connection:
        return loops.ids_of(connection, [tag])[tag]


def spoil(backend: Backend, loop_id: int, start_ns: int) -> None:
    """The stretch of a loop that begins then is there, and cannot be read."""
    at = (series.c.loop_id == loop_id, series.c.start_ns == start_ns)
    with backend.database.write() as connection:
        packed = connection.scalars(select(series.c.packed).where(*at)).one()
        turned = packed[:-9] + bytes(255 - byte for byte in packed[-9:])
        connection.execute(update(series).where(*at).values(packed=turned))
