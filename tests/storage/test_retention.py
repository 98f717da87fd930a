"""What is old goes, and what was used or sent since stays, each by its own row."""

from datetime import timedelta

from sqlalchemy import Connection, insert, select

from app.storage import Database, retention, tables
from app.storage.types import now

DAY = timedelta(days=1)


def upload(connection: Connection, name: str, state: str, ended: int, again: int | None) -> None:
    """ended, again: so many days ago."""
    told = {"content_key": name, "fingerprint": name, "filename": name, "size_bytes": 1, "state": state}
    at = {"received_at": now() - ended * DAY, "ended_at": now() - ended * DAY}
    sent_again = {"sent_again_at": None if again is None else now() - again * DAY}
    connection.execute(insert(tables.uploads).values(told | at | sent_again))


def test_an_upload_that_was_sent_again_is_as_old_as_that(database: Database) -> None:
    """Also where its bytes are kept for less long than its receipt is."""
    with database.write() as connection:
        for state in ("done", "failed"):
            upload(connection, f"{state}, long ago", state, 30, None)
            upload(connection, f"{state}, again long ago", state, 30, 20)
            upload(connection, f"{state}, again since", state, 30, 7)
            upload(connection, f"{state}, lately", state, 7, None)
        old, exports_since = now() - 10 * DAY, now() - 5 * DAY
        assert retention.drop_uploads(connection, old, 100, exports_since=exports_since) == 4
        assert retention.drop_uploads(connection, old, 100, exports_since=exports_since) == 0
        kept = set(connection.scalars(select(tables.uploads.c.filename)))
    assert kept == {f"{state}, {when}" for state in ("done", "failed") for when in ("again since", "lately")}


def test_sessions_go_that_have_ended_and_no_others(database: Database) -> None:
    key = {"public_id": "a", "secret_hash": "a", "name": "a", "role": "read", "requests_per_minute": 60}
    with database.write() as connection:
        making = insert(tables.keys).values(**key, created_at=now()).returning(tables.keys.c.id)
        opened = {"key_id": connection.execute(making).scalar_one(), "created_at": now() - 2 * DAY}
        ends = {"ended": now() - DAY, "ended just now": now() - timedelta(seconds=1), "goes on": now() + DAY}
        for name, at in ends.items():
            connection.execute(insert(tables.sessions).values(**opened, token_hash=name, expires_at=at))
        assert retention.drop_sessions(connection, 100) == 2
        assert list(connection.scalars(select(tables.sessions.c.token_hash))) == ["goes on"]
