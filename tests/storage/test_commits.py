"""A transaction whose COMMIT fails: refused, or with an answer that was lost."""

import sqlite3
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from sqlalchemy import Connection, create_engine, delete, text
from sqlalchemy.exc import DBAPIError, IntegrityError, OperationalError

from app.storage import Database
from app.storage.database import CommitLostError
from app.storage.tables import notes
from app.storage.verdicts import texts

HUNG_UP = text("SELECT pg_terminate_backend(:of, 5000)")  # and waits until it is gone
NO_LOOP = text("INSERT INTO notes (id, loop_id, written_at) VALUES (1, 77, '2026-01-01 00:00:00+00:00')")


@pytest.fixture
def other(database: Database) -> Iterator[Connection]:
    """Another connection to the server."""
    if database.is_sqlite:
        pytest.skip("there is no server")
    engine = create_engine(database.url)
    with engine.connect() as connection:
        yield connection
    engine.dispose()


def hang_up(connection: Connection, other: Connection) -> None:
    other.execute(HUNG_UP, {"of": connection.scalar(text("SELECT pg_backend_pid()"))})


def hang_up_and_ask(connection: Connection, other: Connection) -> None:
    hang_up(connection, other)
    connection.execute(text("SELECT 1"))


def break_a_rule(connection: Connection) -> None:
    """One that is looked at when all is written."""
    if connection.dialect.name == "sqlite":
        connection.exec_driver_sql("PRAGMA defer_foreign_keys = ON")
        connection.execute(NO_LOOP)
    else:
        connection.exec_driver_sql("CREATE TEMPORARY TABLE once (a int UNIQUE DEFERRABLE INITIALLY DEFERRED)")
        connection.exec_driver_sql("INSERT INTO once VALUES (1), (1)")


def test_where_the_server_is_gone_at_the_end_nobody_knows(database: Database, other: Connection) -> None:
    with pytest.raises(CommitLostError), database.write() as connection:
        hang_up(connection, other)
    with database.write() as connection:  # the next one is well
        assert connection.scalar(text("SELECT 1")) == 1


def test_where_the_server_is_gone_before_the_end_nothing_was_changed(database: Database, other: Connection) -> None:
    with pytest.raises(OperationalError) as raised, database.write() as connection:
        hang_up_and_ask(connection, other)
    assert not isinstance(raised.value, CommitLostError)


def lock_out(connection: Connection, other: Connection) -> None:
    connection.exec_driver_sql("SET statement_timeout = 100")
    other.exec_driver_sql("LOCK TABLE newest_rows")


@pytest.mark.parametrize("happens", [hang_up, lock_out])
def test_what_the_driver_reads_by_itself_fails_as_all_else_does(
    database: Database, other: Connection, happens: Callable[[Connection, Connection], None]
) -> None:
    def read() -> None:
        with database.read() as connection:
            happens(connection, other)
            texts(connection, [1], "form")

    with pytest.raises(OperationalError):
        read()


@pytest.mark.parametrize("told", ["idle_in_transaction_session_timeout = 100", "transaction_read_only = on"])
def test_a_server_that_ends_a_transaction_or_takes_no_writes_is_away(
    database: Database, other: Connection, told: str
) -> None:
    def write() -> None:
        with database.write() as connection:
            connection.exec_driver_sql(f"SET LOCAL {told}")
            time.sleep(0.5)
            connection.execute(delete(notes))

    with pytest.raises(OperationalError) as raised:
        write()
    assert not isinstance(raised.value, CommitLostError)


@pytest.mark.parametrize("opened", [Database.read, Database.write])
def test_so_is_one_that_ends_a_transaction_for_its_length(
    database: Database, other: Connection, opened: Callable[..., Any]
) -> None:
    """`transaction_timeout`, of PostgreSQL 17; raised here as an older one can."""
    with pytest.raises(OperationalError), opened(database) as connection:
        connection.exec_driver_sql("DO $$ BEGIN RAISE EXCEPTION 'too long' USING ERRCODE = '25P04'; END $$")


def test_a_refusal_is_an_answer(database: Database) -> None:
    with pytest.raises(IntegrityError), database.write() as connection:
        break_a_rule(connection)


@pytest.mark.parametrize(
    ("name", "unknown"), [("SQLITE_BUSY", False), ("SQLITE_FULL", False), ("SQLITE_IOERR_FSYNC", True)]
)
def test_sqlite_says_what_it_did(database: Database, monkeypatch: pytest.MonkeyPatch, name: str, unknown: bool) -> None:
    if not database.is_sqlite:
        pytest.skip("words of SQLite")
    error = sqlite3.OperationalError(name)
    error.sqlite_errorname = name

    def fails(_: object) -> None:
        raise error

    monkeypatch.setattr(database.writer.dialect, "do_commit", fails)
    with pytest.raises(OperationalError) as raised, database.write():
        pass
    assert isinstance(raised.value, CommitLostError) == unknown


def test_what_is_written_where_one_reads_is_a_fault_of_ours_and_no_server_that_is_away(database: Database) -> None:
    with pytest.raises(DBAPIError) as refused, database.read() as connection:
        connection.execute(delete(notes))
    assert isinstance(refused.value, OperationalError) is database.is_sqlite  # which has one class for both
