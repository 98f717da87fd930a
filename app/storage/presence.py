"""Who works on a PostgreSQL database, told by a lock of a session: it ends with the process that holds it, however
that ends, and with the database's own restart."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from sqlalchemy import NullPool, create_engine, event, func, select
from sqlalchemy.exc import DBAPIError

from app.storage import own_session
from app.storage.database import parsed

KEY = int.from_bytes(b"loopaudt")  # of all processes of loopaudit on one database


@contextmanager
def present(url: str, *, alone: bool) -> Iterator[bool]:
    """Whether a place among those who work on the database was free, or, `alone`, nobody has one; it is held
    meanwhile. True on SQLite, whose folder tells it.

    Raises what SQLAlchemy raises where the database does not answer.
    """
    address = parsed(url)
    if address.get_backend_name() == "sqlite":
        yield True
        return
    lock, unlock = (
        (func.pg_try_advisory_lock, func.pg_advisory_unlock)
        if alone
        else (func.pg_try_advisory_lock_shared, func.pg_advisory_unlock_shared)
    )
    told = {"connect_timeout": 5, "application_name": "loopaudit"}
    engine = create_engine(address, poolclass=NullPool, isolation_level="AUTOCOMMIT", connect_args=told)
    event.listen(engine, "connect", lambda connection, _: own_session.take(connection, {}))
    with engine.connect() as connection:
        held = bool(connection.scalar(select(lock(KEY))))
        try:
            yield held
        finally:
            # The server ends a closed session a moment later: who is told of the end must find the place free.
            with suppress(DBAPIError):
                if held:
                    connection.scalar(select(unlock(KEY)))
