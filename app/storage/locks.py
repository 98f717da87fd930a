"""The locks by which one transaction waits for another on PostgreSQL, each with a number of its own: two things under
one number would wait for each other."""

from enum import IntEnum, unique

from sqlalchemy import Connection, func, select


@unique
class Lock(IntEnum):
    MIGRATING = 705161
    ONE_RUN = 705162
    NEW_LOOPS = 705163
    TAGS = 705164
    RETENTION = int.from_bytes(b"retained")


def hold(connection: Connection, lock: Lock) -> None:
    """Until the transaction ends. Nothing on SQLite, where every transaction that writes waits already."""
    if connection.dialect.name == "postgresql":
        connection.execute(select(func.pg_advisory_xact_lock(lock.value)))
