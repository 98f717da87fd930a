"""A session of PostgreSQL has our settings behind a pooler too, and is nobody else's."""

import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial

import psycopg
import pytest
from sqlalchemy import Connection, make_url
from sqlalchemy.exc import OperationalError

from app.storage import Database
from app.storage import database as storage_database
from app.storage import presence as storage_presence
from app.storage.presence import present

SETTINGS = ("statement_timeout", "timezone", "jit", "idle_in_transaction_session_timeout")
READ_ONLY = "default_transaction_read_only"


@contextmanager
def opened(url: str) -> Iterator[Database]:
    database = Database(url, statement_timeout_s=7)
    try:
        yield database
    finally:
        database.close()


def connected(url: str) -> psycopg.Connection:
    own = make_url(url).set(drivername="postgresql")
    return psycopg.connect(own.render_as_string(hide_password=False), autocommit=True)


def setting(connection: Connection, name: str) -> object:
    return connection.exec_driver_sql(f"SHOW {name}").scalar()


@pytest.fixture
def elsewhere(postgres_url: str) -> Iterator[str]:
    """A database whose own settings are others than ours."""
    other = {"timezone": "'Asia/Tokyo'", "jit": "on", "statement_timeout": "'1h'"}
    name = make_url(postgres_url).database
    with connected(postgres_url) as own:
        for key, value in other.items():
            own.execute(f'ALTER DATABASE "{name}" SET {key} TO {value}')
        yield postgres_url
        for key in other:
            own.execute(f'ALTER DATABASE "{name}" RESET {key}')


@pytest.mark.postgres
def test_a_session_has_our_settings_whatever_those_of_the_database_are(elsewhere: str) -> None:
    with opened(elsewhere) as database:
        with database.read() as read:
            assert [setting(read, name) for name in (*SETTINGS, READ_ONLY)] == ["7s", "UTC", "off", "1min", "on"]
        with database.writer.connect() as rolled_back:  # with what was set in its transaction
            rolled_back.exec_driver_sql("SELECT 1")
        with database.write() as written:
            assert [setting(written, name) for name in (*SETTINGS, READ_ONLY)] == ["7s", "UTC", "off", "1min", "off"]


@pytest.mark.postgres
def test_settings_of_the_address_are_kept(postgres_url: str) -> None:
    url = make_url(postgres_url).update_query_dict({"options": "-c search_path=plant"})
    with opened(url.render_as_string(hide_password=False)) as database, database.read() as read:
        assert (setting(read, "search_path"), setting(read, "jit")) == ("plant", "off")


@pytest.mark.postgres
def test_a_connection_begins_without_what_a_pooler_refuses(postgres_url: str) -> None:
    """PgBouncer takes of `options` what it is told to drop, and refuses a connection for the rest."""
    with opened(postgres_url) as database, database.read() as read, database.write() as written:
        for connection in (read, written):
            assert "options" not in connection.connection.driver_connection.info.get_parameters()


@pytest.fixture
def lent(postgres_url: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[psycopg.Connection]:
    """As of a pooler that lends its one session to each transaction, whoever sends it."""
    with connected(postgres_url) as session:
        for module in (storage_database, storage_presence):
            monkeypatch.setattr(module, "create_engine", partial(module.create_engine, creator=lambda: session))
        yield session


@pytest.mark.postgres
def test_a_session_that_others_use_too_is_refused(lent: psycopg.Connection, postgres_url: str) -> None:
    """A writer would be read-only as the reader is, and a restore would not see who is at work."""
    with opened(postgres_url) as database:
        with database.read() as read:
            read.exec_driver_sql("SELECT 1")
        with pytest.raises(OperationalError, match=r"pool_mode=session"), database.write():
            pytest.fail("a session of two connections was used")
        assert lent.closed


@pytest.mark.postgres
def test_who_is_at_work_is_not_told_by_a_session_that_others_use(lent: psycopg.Connection, postgres_url: str) -> None:
    with opened(postgres_url) as database:
        with database.read() as read:
            read.exec_driver_sql("SELECT 1")
        with pytest.raises(OperationalError, match=r"pool_mode=session"), present(postgres_url, alone=True):
            pytest.fail("a lock of two connections was held")


@pytest.mark.postgres
def test_a_session_that_was_reset_is_as_new(lent: psycopg.Connection, postgres_url: str) -> None:
    """As PgBouncer does it before another connection gets a session for itself."""
    with opened(postgres_url) as database:
        with database.read() as read:
            read.exec_driver_sql("DISCARD ALL")
        with database.write() as written:
            assert (setting(written, "jit"), setting(written, READ_ONLY)) == ("off", "off")


@pytest.mark.postgres
@pytest.mark.parametrize("writes", [True, False])
@pytest.mark.parametrize("exit_by", [KeyboardInterrupt, SystemExit])
def test_who_interrupts_a_statement_is_no_database_that_is_away(
    postgres_url: str, exit_by: type[BaseException], writes: bool
) -> None:
    """The connection is lost with it, and a worker that was told to end would take that for a fault and try again."""

    def interrupt(*_: object) -> None:
        raise exit_by

    def wait(connected_to: Callable[[], AbstractContextManager[Connection]]) -> None:
        with connected_to() as connection:
            signal.setitimer(signal.ITIMER_REAL, 0.1)
            connection.exec_driver_sql("SELECT pg_sleep(5)")

    with opened(postgres_url) as database:
        kept = signal.signal(signal.SIGALRM, interrupt)
        try:
            with pytest.raises(exit_by):
                wait(database.write if writes else database.read)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, kept)
