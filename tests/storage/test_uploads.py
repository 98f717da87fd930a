"""Uploads in both data bases: which bytes are still to be read."""

import pytest
from sqlalchemy import Connection

from app.storage import Database, uploads

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
