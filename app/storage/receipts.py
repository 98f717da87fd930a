"""The order in which uploads were received, which decides between them: not that in which they are read."""

from sqlalchemy import Connection, func, select

from app.storage.bulk import insert_for
from app.storage.tables import UNREAD, numbers, uploads

UPLOADS = "uploads"


def next_number(connection: Connection) -> int:
    """Larger than any before. Nobody else gets one until the transaction ends: whoever sees a number sees all before
    it."""
    inserting = insert_for(connection, numbers).values(name=UPLOADS, last=1)
    counted = inserting.on_conflict_do_update(index_elements=["name"], set_={"last": numbers.c.last + 1})
    return int(connection.scalar(counted.returning(numbers.c.last)))


def unread_before(connection: Connection, number: int) -> int:
    """The number of the newest upload that was received before this one and is not read yet; 0: none."""
    query = select(func.max(uploads.c.receipt_number)).where(UNREAD, uploads.c.receipt_number < number)
    return connection.scalar(query) or 0
