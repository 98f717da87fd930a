"""Opens the database: one engine to write with, one to read with."""

import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, make_url
from sqlalchemy.engine import URL, ExceptionContext
from sqlalchemy.exc import ArgumentError, DBAPIError, OperationalError
from sqlalchemy.pool import QueuePool

from app.errors import RequestError
from app.sqlite_files import asks_for_no_writes
from app.storage import own_session
from app.storage.own_file import OwnFile

BUSY_TIMEOUT_MS = 30_000
WAL_SAFE_FROM = (3, 51, 3)
MOST_OF_A_FILE = 15
"""Connections that SQLAlchemy's pool opens where nothing is said: 5, and 10 more."""
READ_ONLY = "25006"
HUNG_UP = ("25P03", "25P04")
"""SQLSTATEs of a server that ended a transaction for its idleness, or for its length (`transaction_timeout`). The
driver has them in one class with damaged data, as it has READ_ONLY, that of a server that takes no writes (a standby,
or one whose disk ran full and that is looked after so)."""


LOST_AFTER_30_S = {
    "keepalives_idle": 10,
    "keepalives_interval": 5,
    "keepalives_count": 4,
    "tcp_user_timeout": 30_000,
}
"""Of a connection whose other end is gone without a word, as with its power or the way to it: else who waits for an
answer learns it after two hours, and who sends after a quarter of an hour. In seconds, the last in milliseconds."""


class CommitLostError(OperationalError):
    """The answer to COMMIT was lost: what was written may stand, or not."""


class Database:
    """Short transactions: `with database.write() as connection`, `with database.read() as connection`.

    Open it after any fork; it is safe to use from several threads.
    """

    def __init__(self, url: str, *, statement_timeout_s: float = 15.0, pool_size: int = 5) -> None:
        self.url: URL = parsed(url)
        self.is_sqlite = self.url.get_backend_name() == "sqlite"
        self._most = MOST_OF_A_FILE if self.is_sqlite else 2 * pool_size
        if self.is_sqlite:
            file = OwnFile(self.url.database or "")
            self._writer, self._reader = _sqlite(self.url, file, writes=True), _sqlite(self.url, file, writes=False)
        else:
            self._writer = _postgresql(self.url, statement_timeout_s, pool_size, writes=True)
            self._reader = _postgresql(self.url, statement_timeout_s, pool_size, writes=False)

    @contextmanager
    def write(self) -> Iterator[Connection]:
        """One transaction, committed at the end, rolled back by an exception. On SQLite it holds the write lock.

        Raises CommitLostError where it is not known whether it was committed.
        """
        with self._writer.begin() as connection:
            yield connection
            _commit(connection)

    @contextmanager
    def read(self) -> Iterator[Connection]:
        """For reading; writing fails."""
        with self._reader.connect() as connection:
            yield connection

    def answers(self) -> float:
        """In how many seconds; whoever asks does not wait for a connection that others use. Raises what SQLAlchemy
        raises where it does not answer."""
        begun = time.perf_counter()
        with self._beside_the_others() if self.is_read_by_all() else self.read() as connection:
            connection.exec_driver_sql("SELECT 1")
        return time.perf_counter() - begun

    def is_read_by_all(self) -> bool:
        """Whether all connections to read with are in use: the next reader waits."""
        return self._all_in_use(self._reader)

    def _all_in_use(self, engine: Engine) -> bool:
        return isinstance(engine.pool, QueuePool) and engine.pool.checkedout() >= self._most

    @contextmanager
    def _beside_the_others(self) -> Iterator[Connection]:
        """A connection to read with that is none of the pool's."""
        beside = create_engine(self.url, pool=self._reader.pool.recreate())
        try:
            with beside.connect() as connection:
                yield connection
        finally:
            beside.dispose()

    def takes_writes(self) -> bool | None:
        """Not on a standby, on a server that was made read-only, or on a file system that is mounted so. None where all
        connections to write with are in use: whoever asks does not wait for one. Raises what SQLAlchemy raises where
        the database does not answer."""
        if self.is_sqlite:
            return self._file_takes_writes()
        if self._all_in_use(self._writer):
            return None
        with self.write() as connection:
            return bool(connection.exec_driver_sql("SHOW transaction_read_only").scalar() == "off")

    def _file_takes_writes(self) -> bool:
        """SQLite says which file it is: an address may be a URI, which may ask for no writes. What is in memory has
        no file."""
        if asks_for_no_writes(self.url):
            return False
        with self.read() as connection:
            name = connection.exec_driver_sql("SELECT file FROM pragma_database_list WHERE name = 'main'").scalar()
        return not name or all(os.access(path, os.W_OK) for path in (Path(name), Path(name).parent))

    @property
    def writer(self) -> Engine:
        """For migrations."""
        return self._writer

    def close(self) -> None:
        self._writer.dispose()
        self._reader.dispose()


def _commit(connection: Connection) -> None:
    transaction = connection.get_transaction()
    if transaction is None:
        return
    try:
        transaction.commit()
    except DBAPIError as error:
        if error.orig is None or not _may_be_done(error):
            raise
        raise CommitLostError("COMMIT", None, error.orig) from error


def _may_be_done(error: DBAPIError) -> bool:
    """Of a COMMIT that failed: a refusal is an answer, and nothing was changed; a server that is gone gave none, and
    SQLite may fail to write when the rest is written."""
    told = getattr(error.orig, "sqlite_errorname", None)
    if told is not None:
        return bool(told.startswith("SQLITE_IOERR"))
    return error.connection_invalidated or getattr(error.orig, "sqlstate", None) is None


@contextmanager
def in_driver(connection: Connection) -> Iterator[Any]:
    """The driver's own connection, whose errors are raised as those of all other statements are: whoever waits for a
    database that is away, or says so, knows these alone."""
    driver: Any = connection.connection.driver_connection
    errors = connection.dialect.loaded_dbapi.Error
    try:
        yield driver
    except errors as error:
        raise DBAPIError.instance(None, None, error, errors, dialect=connection.dialect) from error


def parsed(url: str) -> URL:
    """Raises RequestError where this is no address of PostgreSQL or SQLite; the driver is the one that we install."""
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError):
        parsed = None
    backend = None if parsed is None else parsed.get_backend_name()
    if parsed is None or backend not in ("sqlite", "postgresql", "postgres"):
        need = "postgresql+psycopg://user@host/name or sqlite:///path is needed"
        raise RequestError("database_url", f"LOOPAUDIT_DATABASE_URL is no address of a database that we use; {need}")
    return parsed if backend == "sqlite" else parsed.set(drivername="postgresql+psycopg")


@dataclass(frozen=True)
class ProgramAddress:
    """A database as the programs of PostgreSQL take it: all that its address says (TLS too) but the password, which
    other users of the machine must not see among their arguments."""

    url: str
    password: str | None


def program_address(url: URL) -> ProgramAddress:
    password = url.password or url.query.get("password")
    shown = URL.create("postgresql", url.username, None, url.host, url.port, url.database, url.query)
    shown = shown.difference_update_query(["password"])
    return ProgramAddress(shown.render_as_string(), None if password is None else str(password))


def journal_mode() -> str:
    """WAL only where SQLite can be trusted with it: versions before 3.51.3 may corrupt it when two processes write."""
    return "WAL" if sqlite3.sqlite_version_info >= WAL_SAFE_FROM else "TRUNCATE"


def _sqlite(url: URL, file: OwnFile, *, writes: bool) -> Engine:
    engine = create_engine(url, connect_args={"timeout": BUSY_TIMEOUT_MS / 1000, "check_same_thread": False})
    file.keep(engine)

    @event.listens_for(engine, "connect")
    def prepare(connection: Any, _: Any) -> None:
        # The driver must not begin transactions by itself: see `begin`.
        connection.isolation_level = None
        connection.execute(f"PRAGMA busy_timeout = {BUSY_TIMEOUT_MS}")
        connection.execute(f"PRAGMA journal_mode = {journal_mode()}")
        connection.execute("PRAGMA foreign_keys = ON")
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA mmap_size = 0")
        # SQLite's own knows no letters but those of ASCII: who looks for "öl" would not find "Ölpumpe".
        connection.create_function("lower", 1, _lower, deterministic=True)
        if not writes:
            connection.execute("PRAGMA query_only = ON")

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        # A deferred transaction that reads, then writes, loses updates or fails at once; IMMEDIATE waits its turn.
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine


def _lower(text: str | None) -> str | None:
    return None if text is None else text.lower()


def _postgresql(url: URL, statement_timeout_s: float, pool_size: int, *, writes: bool) -> Engine:
    import psycopg
    from psycopg.types.array import ListBinaryDumper

    settings = {
        "statement_timeout": str(int(statement_timeout_s * 1000)),
        "timezone": "UTC",
        "idle_in_transaction_session_timeout": "60000",
        # Statements that join many tables were compiled for half a second and ran for a tenth: PostgreSQL decides by
        # what all rows would cost, of which ours look at few.
        "jit": "off",
    }
    if not writes:
        settings["default_transaction_read_only"] = "on"
    engine = create_engine(
        url,
        # A reader sees what is committed at each statement, with or without a transaction around it; without one, a
        # query costs one round trip instead of three.
        isolation_level="READ COMMITTED" if writes else "AUTOCOMMIT",
        pool_size=pool_size,
        max_overflow=pool_size,  # so `_most` in all
        pool_timeout=10,
        pool_pre_ping=True,
        connect_args={
            "connect_timeout": 5,
            **LOST_AFTER_30_S,
            "application_name": "loopaudit",
            "client_encoding": "utf8",  # rows are sent on as they come, whatever a database stores them in
        },
    )

    @event.listens_for(engine, "handle_error", retval=True)
    def as_away(context: ExceptionContext) -> Exception | None:
        told: Any = context.original_exception
        state = getattr(told, "sqlstate", None)
        # A pooler that lost the server of a session says so after the server did; the driver calls two answers a fault.
        said = isinstance(told, psycopg.Error)  # whoever interrupts a statement loses the connection too
        lost = context.is_disconnect and said and not isinstance(told, psycopg.OperationalError)
        if not lost and state not in HUNG_UP and not (writes and state == READ_ONLY):
            return None
        return OperationalError(context.statement, context.parameters, told, connection_invalidated=lost)

    @event.listens_for(engine, "connect")
    def prepare(connection: Any, _: Any) -> None:
        own_session.take(connection, settings)
        # Bytes as text are two digits each, escaped twice in an array: a twentieth of the time without that.
        connection.adapters.register_dumper(list, ListBinaryDumper)

    return engine
