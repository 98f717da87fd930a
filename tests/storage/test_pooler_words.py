"""A pooler that loses the server of a session says so after the server has: its client is told twice."""

import socket
import socketserver
import struct
import threading
from collections.abc import Iterator

import psycopg
import pytest
from sqlalchemy import Connection, make_url
from sqlalchemy.exc import OperationalError

from app.storage import Database
from app.storage.database import CommitLostError

pytestmark = pytest.mark.postgres
FIELDS = b"SFATAL\0C08P01\0Mserver conn crashed?\0\0"
ITS_WORD = b"E" + struct.pack(">i", 4 + len(FIELDS)) + FIELDS


class OfOneClient(socketserver.BaseRequestHandler):
    def handle(self) -> None:
        with socket.create_connection(self.server.behind) as server:
            up = threading.Thread(target=passed_on, args=(self.request, server, b""))
            up.start()
            passed_on(server, self.request, ITS_WORD)
            up.join()


def passed_on(source: socket.socket, target: socket.socket, last: bytes) -> None:
    try:
        while some := source.recv(65536):
            target.sendall(some)
        target.sendall(last)
        target.shutdown(socket.SHUT_RDWR)
    except OSError:  # the other direction has ended it
        pass


@pytest.fixture
def pooled(postgres_url: str) -> Iterator[Database]:
    url = make_url(postgres_url)
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), OfOneClient) as pooler:
        pooler.behind = (url.host or "127.0.0.1", url.port or 5432)
        threading.Thread(target=pooler.serve_forever).start()
        here = url.set(host="127.0.0.1", port=pooler.server_address[1]).update_query_dict(
            {"sslmode": "disable", "gssencmode": "disable"}
        )
        database = Database(here.render_as_string(hide_password=False))
        try:
            yield database
        finally:
            database.close()
            pooler.shutdown()


def end(session: object, postgres_url: str) -> None:
    with psycopg.connect(make_url(postgres_url).set(drivername="postgresql").render_as_string(False)) as other:
        other.execute("SELECT pg_terminate_backend(%s, 5000)", [session])


def session_of(connection: Connection) -> object:
    """Without a transaction."""
    driver = connection.connection.driver_connection
    kept, driver.autocommit = driver.autocommit, True
    found = driver.execute("SELECT pg_backend_pid()").fetchone()[0]
    driver.autocommit = kept
    return found


def test_a_session_that_is_lost_before_its_transaction_begins_is_away(pooled: Database, postgres_url: str) -> None:
    def write() -> None:
        with pooled.write() as connection:
            end(session_of(connection), postgres_url)
            connection.exec_driver_sql("SELECT 1")

    with pytest.raises(OperationalError) as raised:
        write()
    assert raised.value.connection_invalidated
    with pooled.write() as connection:  # the next one is well
        assert connection.exec_driver_sql("SELECT 1").scalar() == 1


def test_of_what_was_written_when_it_is_lost_at_the_end_nobody_knows(pooled: Database, postgres_url: str) -> None:
    def write() -> None:
        with pooled.write() as connection:
            end(connection.exec_driver_sql("SELECT pg_backend_pid()").scalar(), postgres_url)

    with pytest.raises(CommitLostError):
        write()
