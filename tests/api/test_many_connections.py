"""Connections that ask for nothing: they take neither the files of the process nor the places of other addresses."""

import socket
from collections.abc import Iterator

import pytest

from app.http import connections
from app.main import create_app
from app.settings import Settings
from tests.conftest import listening

MOST = 8
ASKED = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"


@pytest.fixture
def address(tmp_path, make_tables) -> Iterator[tuple[str, int]]:
    settings = Settings(data_dir=tmp_path)
    make_tables(settings)
    with listening(create_app(settings), http=connections.HeadDeadline, limit_concurrency=MOST) as found:
        yield found


def connected(address: tuple[str, int], source: str) -> socket.socket:
    return socket.create_connection(address, timeout=5, source_address=(source, 0))


def is_closed(connection: socket.socket) -> bool:
    connection.settimeout(0.3)
    try:
        return connection.recv(1) == b""
    except TimeoutError:
        return False
    except ConnectionError:
        return True


def is_answered(connection: socket.socket) -> bool:
    connection.settimeout(5)
    connection.sendall(ASKED)
    return connection.recv(1000).startswith(b"HTTP/1.1 200")


def test_of_one_address_half_of_the_connections_are_kept_and_others_are_answered(address):
    idle = [connected(address, "127.0.0.1") for _ in range(MOST)]
    try:
        assert [is_closed(one) for one in idle] == [False] * (MOST // 2) + [True] * (MOST // 2)
        with connected(address, "127.0.0.2") as other:
            assert is_answered(other)
        assert is_answered(idle[0])
    finally:
        for one in idle:
            one.close()


def test_above_the_limit_of_the_server_none_is_kept(address):
    idle = [connected(address, f"127.0.0.{1 + number % 4}") for number in range(MOST + 2)]
    try:
        assert [is_closed(one) for one in idle] == [False] * MOST + [True] * 2
        assert is_answered(idle[0])
    finally:
        for one in idle:
            one.close()
