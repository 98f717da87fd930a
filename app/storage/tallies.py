"""What was counted of rows that are gone, so that a counter never goes down when old ones are dropped."""

from sqlalchemy import Connection, select

from app.storage.bulk import insert_for
from app.storage.tables import tallies

UPLOAD_BYTES = "upload_bytes"


def tally(connection: Connection, name: str, dropped: int) -> None:
    inserting = insert_for(connection, tallies).values(name=name, dropped=dropped)
    more = {"dropped": tallies.c.dropped + inserting.excluded.dropped}
    connection.execute(inserting.on_conflict_do_update(index_elements=["name"], set_=more))


def tallied(connection: Connection, name: str) -> int:
    return connection.scalar(select(tallies.c.dropped).where(tallies.c.name == name)) or 0
