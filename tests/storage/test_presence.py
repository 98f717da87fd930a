"""Who works on a PostgreSQL database is known at once when it ends."""

import pytest
from sqlalchemy import Pool, event

from app.storage.presence import present

HELD = "SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND pid = pg_backend_pid()"


@pytest.mark.parametrize("alone", [False, True])
def test_the_place_is_free_before_the_session_closes(postgres_url: str, alone: bool) -> None:
    """A server ends a closed session a moment later: under load a restore was refused for a process that had ended."""
    held: list[int] = []

    def at_end(session: object, _: object) -> None:
        with session.cursor() as cursor:
            held.append(cursor.execute(HELD).fetchone()[0])

    event.listen(Pool, "checkin", at_end)
    try:
        with present(postgres_url, alone=alone) as free:
            assert free
    finally:
        event.remove(Pool, "checkin", at_end)
    assert held == [0]


def test_alone_is_alone(postgres_url: str) -> None:
    with present(postgres_url, alone=False) as one, present(postgres_url, alone=False) as other:
        with present(postgres_url, alone=True) as nobody_else:
            assert (one, other, nobody_else) == (True, True, False)
        with present(postgres_url, alone=False) as still:
            assert still
    with present(postgres_url, alone=True) as nobody_else, present(postgres_url, alone=False) as beside:
        assert (nobody_else, beside) == (True, False)
