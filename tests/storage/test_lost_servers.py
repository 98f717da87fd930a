"""A server whose machine is gone says nothing any more: its connections are given up in time."""

import pytest
from sqlalchemy import Connection

from app.storage import Database


def given_up_after_s(connection: Connection) -> tuple[float, float]:
    """While an answer is awaited, and while something is sent."""
    told = connection.connection.driver_connection.info.get_parameters()
    pauses = int(told["keepalives_interval"]) * int(told["keepalives_count"])
    return int(told["keepalives_idle"]) + pauses, int(told["tcp_user_timeout"]) / 1000


@pytest.mark.postgres
def test_each_connection_is_given_up_before_a_lease_ends(emptied_postgres: str) -> None:
    database = Database(emptied_postgres)
    try:
        with database.write() as written:
            assert given_up_after_s(written) == (30.0, 30.0)
        with database.read() as read:
            assert given_up_after_s(read) == (30.0, 30.0)
    finally:
        database.close()
