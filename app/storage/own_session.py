"""A connection to PostgreSQL has a session of its own, with the settings that ours need, behind a pooler too."""

from collections.abc import Mapping
from typing import Any

TAKEN = "loopaudit.taken"
"""A setting that a new session does not have, and one that was reset neither."""

SHARED = (
    "a pooler lends sessions of the database to one transaction after another, and loopaudit needs sessions of its own;"
    " with PgBouncer set pool_mode=session and server_reset_query=DISCARD ALL, or give the server's own address"
)


def take(connection: Any, settings: Mapping[str, str]) -> None:
    """Gives the session of a driver's connection that has just been made these settings, in one round trip. They are
    not among what the connection starts with (`options`): PgBouncer refuses those, or drops them where it is told to.

    Raises the driver's OperationalError where another connection of loopaudit has this session, or had it and left it
    as it was. A lock of the session would be held for somebody else, a writer would be as read-only as a reader, and
    statements that one connection has prepared are unknown to the next.
    """
    from psycopg import OperationalError  # an extra: there is no PostgreSQL without it

    pairs = {TAKEN: "yes", **settings}
    asked = ", ".join(["current_setting(%s, true)", *("set_config(%s, %s, false)" for _ in pairs)])
    kept, connection.autocommit = connection.autocommit, True  # what is set in a transaction ends with its rollback
    values = [text for pair in pairs.items() for text in pair]
    try:
        if connection.execute(f"SELECT {asked}", [TAKEN, *values]).fetchone()[0]:
            raise OperationalError(SHARED)
    except BaseException:
        connection.close()  # nobody else has it yet
        raise
    connection.autocommit = kept
