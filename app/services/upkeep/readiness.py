"""Whether the service can work: its database, the schema, the disk and the broker."""

from sqlalchemy.exc import SQLAlchemyError

from app.counting import megabytes
from app.services.backend import Backend
from app.services.data_folder import folder_state, free_bytes
from app.services.database_errors import no_connection_left
from app.services.moments import iso_utc
from app.services.outward import ReadyOut
from app.storage import schema, uploads

LEAST_FREE_BYTES = 100 << 20
WRITES = {True: "ok", False: "read-only", None: "busy"}
WELL = ("ok", "busy")
NO_ANSWER = ReadyOut("not_ready", {"database": "no answer", "schema": "not known"})
"""Where it takes too long to find out."""


def readiness(backend: Backend) -> ReadyOut:
    """Database, schema and disk must be well. A broker that is away only slows things down, and of a database or a
    data folder that takes no writes the pages can be read; one that is busy with them takes them. Where all connections
    to read with are in use, what would need one of them is not known."""
    free, folder = free_bytes(backend.settings), folder_state(backend.settings)
    checks: dict[str, object] = {"database": _database(backend), "disk_free_bytes": free, "data_folder": folder}
    checks["schema"] = _schema(backend) if checks["database"] == "ok" else "not known"
    checks["broker"] = _broker(backend)
    busy, well = checks["database"] == "busy", checks["schema"] == "current"
    if well:
        checks |= {"writes": _writes(backend)} | _waiting_for_room(backend)
    if not (well or busy) or free < LEAST_FREE_BYTES or folder == "gone":
        return ReadyOut("not_ready", checks)
    works = not busy and checks["broker"] == folder == "ok" and checks["writes"] in WELL
    return ReadyOut("ready" if works else "degraded", checks)


def lacking(found: ReadyOut) -> list[str]:
    """What is to be put right before the service is ready, in words."""
    checks, free, needed = found.checks, found.checks["disk_free_bytes"], megabytes(LEAST_FREE_BYTES)
    gone = checks["data_folder"] == "gone"
    said = {
        f"the database is {checks['database']}": checks["database"] != "ok",
        "its tables are not those of this version (`loopaudit migrate`)": checks["schema"] == "not current",
        "the data folder is not there": gone,
        f"the disk of the data folder has {megabytes(free)} free, and {needed} are needed": (
            free < LEAST_FREE_BYTES and not gone
        ),
    }
    return [words for words, holds in said.items() if holds]


def _database(backend: Backend) -> str:
    busy = backend.database.is_read_by_all()
    try:
        backend.database.answers()
    except SQLAlchemyError as error:
        return "busy" if busy and no_connection_left(error) else f"away: {type(error).__name__}"
    return "busy" if busy else "ok"


def _broker(backend: Backend) -> str:
    if backend.queue.reachable():
        return "ok"
    return backend.queue.refusal.state if backend.queue.refusal else "away"


def _waiting_for_room(backend: Backend) -> dict[str, object]:
    """Uploads that there is no room to read, and since when the first of them waits."""
    with backend.database.read() as connection:
        count, longest = uploads.waiting_for_room(connection)
    return {
        "uploads_waiting_for_room": count,
        "waiting_for_room_since": iso_utc(longest.waits_since if longest else None),
    }


def _schema(backend: Backend) -> str:
    return "current" if schema.current_revision(backend.database) == schema.newest_revision() else "not current"


def _writes(backend: Backend) -> str:
    try:
        return WRITES[backend.database.takes_writes()]
    except SQLAlchemyError as error:
        return f"away: {type(error).__name__}"
