"""Keys and sessions end when they are to, whatever is asked of them meanwhile."""

from datetime import datetime, timedelta

from sqlalchemy import Connection

from app.storage import Database, keys
from app.storage.types import now

HOUR = timedelta(hours=1)


def key(connection: Connection, name: str, expires_at: datetime | None = None) -> keys.KeyRow:
    values = {"public_id": name, "secret_hash": name, "name": name, "role": "read", "requests_per_minute": 60}
    return keys.add(connection, {**values, "expires_at": expires_at})


def test_a_key_that_gives_way_ends_no_later_than_it_was_to(database: Database) -> None:
    with database.write() as connection:
        sooner, later, never = (
            key(connection, name, ends) for name, ends in (("a", now() + HOUR), ("b", now() + 9 * HOUR), ("c", None))
        )
        at = now() + 2 * HOUR
        assert all(keys.give_way(connection, one.id, at, "its follower") for one in (sooner, later, never))
        ends = [row.expires_at for row in keys.every(connection)]
    assert ends == [sooner.expires_at, at, at]


def test_the_sessions_of_a_revoked_key_are_gone_and_those_of_others_are_not(database: Database) -> None:
    with database.write() as connection:
        revoked, other = key(connection, "a"), key(connection, "b")
        for one in (revoked, other):
            keys.open_session(connection, f"session of {one.name}", one.id, now() + HOUR)
        keys.end(connection, revoked.id, revoked_at=now())
        left = [keys.session(connection, f"session of {one.name}") is not None for one in (revoked, other)]
    assert left == [False, True]


def test_a_session_that_has_ended_is_not_brought_back_by_its_use(database: Database) -> None:
    with database.write() as connection:
        opened_with = key(connection, "a")
        keys.open_session(connection, "goes on", opened_with.id, now() + HOUR)
        keys.open_session(connection, "ended", opened_with.id, now() - HOUR)
        for token in ("ended", "goes on"):
            keys.extend_session(connection, token, now() + 3 * HOUR)
        ended, goes_on = keys.session(connection, "ended"), keys.session(connection, "goes on")
    assert ended is None
    assert goes_on is not None
    assert goes_on.expires_at > now() + 2 * HOUR


def test_a_key_that_is_revoked_again_was_revoked_when_it_was_first(database: Database) -> None:
    with database.write() as connection:
        revoked = key(connection, "a")
        for at in (now() - HOUR, now()):
            keys.end(connection, revoked.id, revoked_at=at)
        (row,) = keys.every(connection)
    assert row.revoked_at is not None
    assert row.revoked_at < now() - HOUR / 2
