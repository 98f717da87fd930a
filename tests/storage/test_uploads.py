"""Uploads in both databases: which bytes are still to be read."""

import pytest
from sqlalchemy import Connection, update

from app.storage import Database, uploads
from app.storage.tables import uploads as table
from app.storage.types import clock_s, now

A, B = "a" * 64, "b" * 64


def received(connection: Connection, fingerprint: str) -> int:
    values = {
        "filename": "a.csv",
        "content_type": None,
        "reading_json": "{}",
        "received_by": None,
        "content_key": fingerprint,
        "fingerprint": fingerprint,
        "size_bytes": 3,
    }
    return uploads.receive(connection, values)[0].id


@pytest.mark.parametrize(("state", "unread"), [("done", {B}), ("failed", {B}), (None, {A, B})])
def test_bytes_are_unread_until_their_upload_has_ended(database: Database, state: str | None, unread: set[str]) -> None:
    with database.write() as connection:
        first = received(connection, A)
        received(connection, B)
        claim = uploads.claim(connection, first, "worker", 60.0, 3)
        if state is not None:
            assert uploads.end(connection, claim, state, {})
        assert uploads.unread_fingerprints(connection) == unread


def test_what_an_upload_was_refused_is_replaced_in_it_alone(database: Database) -> None:
    """It may be read once more, by a worker that took it over."""
    with database.write() as connection:
        first, second = received(connection, A), received(connection, B)
        early = uploads.RejectRow(2, "bad_time", "'soon' is no time that can be read", "A.PV")
        late = uploads.RejectRow(None, "not_a_number", "n/a", "A.OP")
        uploads.replace_rejects(connection, first, [early, late])
        uploads.replace_rejects(connection, second, [late])
        uploads.replace_rejects(connection, first, [late, early])
        assert uploads.rejects_of(connection, first) == [late, early]
        assert uploads.rejects_of(connection, second) == [late]
        uploads.replace_rejects(connection, first, [])
        assert (uploads.rejects_of(connection, first), uploads.rejects_of(connection, second)) == ([], [late])


def announced_after(connection: Connection, seconds: float) -> bool:
    """Whether an upload that was announced so long ago is announced again."""
    connection.execute(update(table).values(announced_s=clock_s() - seconds))
    return bool(uploads.to_announce(connection, 20.0, 40.0))


@pytest.mark.parametrize(
    ("attempts", "pause_s"), [(0, 20), (2, 20), (3, 40), (4, 80), (9, 2560), (10, 2560), (19, 2560)]
)
def test_the_pause_after_a_reading_in_vain_never_gets_shorter(
    database: Database, attempts: int, pause_s: float
) -> None:
    with database.write() as connection:
        received(connection, A)
        connection.execute(update(table).values(state="reading", attempts=attempts, lease_until_s=0.0))
        assert not announced_after(connection, pause_s - 10)
        assert announced_after(connection, pause_s + 10)


@pytest.mark.parametrize(
    ("state", "attempts", "lease_s", "given_up"),
    [
        ("received", 3, None, True),
        ("received", 2, None, False),
        ("reading", 3, -1.0, True),
        ("reading", 3, 30.0, False),
        ("reading", 2, -1.0, False),
        ("done", 3, None, False),
    ],
)
def test_what_nobody_may_try_any_more_is_given_up(
    database: Database, state: str, attempts: int, lease_s: float | None, given_up: bool
) -> None:
    """Fewer tries may be allowed than when it was last tried, and then found no room on the disk."""
    with database.write() as connection:
        upload = received(connection, A)
        until = None if lease_s is None else clock_s() + lease_s
        waiting = {"waits_since": now(), "pause_s": 20.0} if state == "received" else {}
        connection.execute(update(table).values(state=state, attempts=attempts, lease_until_s=until, **waiting))
        assert uploads.give_up(connection, 3, 40.0) == given_up
        row = uploads.by_id(connection, upload)
        assert (row.state, row.error_code) == (("failed", "reader_lost") if given_up else (state, None))
        assert uploads.waiting_for_room(connection)[0] == (state == "received" and not given_up)
        if given_up:
            assert uploads.try_again(connection, upload)
            assert uploads.claim(connection, upload, "w", 40.0, 3) is not None
