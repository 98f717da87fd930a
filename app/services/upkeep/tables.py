"""The tables: whether the database is there and has those of this version, and how it gets them. Imports no engine:
`worker` and `beat` ask it first."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy.exc import OperationalError

from app.errors import RequestError
from app.services.data_folder import NewFolder
from app.services.database_errors import DATABASE_AWAY, away_in_words
from app.services.mounts import FSTAB, place_away
from app.settings import Settings
from app.sqlite_files import file_of
from app.storage import Database, schema

LOCK_NOT_AVAILABLE = "55P03"
"""The SQLSTATE of a lock that was waited for in vain."""

log = logging.getLogger("loopaudit.upkeep")


def migrate(settings: Settings) -> str:
    """Brings the database to this version's tables; returns which version that is. Raises
    RequestError("newer_tables") where a newer loopaudit made them, RequestError("not_mounted").
    """
    refuse_unmounted(settings)
    database = Database(settings.resolved_database_url)
    try:
        with away_in_words():
            NewFolder(settings, database).make()
            refuse_newer(schema.current_revision(database))
            with _in_use_in_words():
                schema.migrate(database)
            _tell_of_no_writes(database)
            return schema.current_revision(database) or "none"
    finally:
        database.close()


@contextmanager
def _in_use_in_words() -> Iterator[None]:
    """PostgreSQL changes no table that somebody has looked at within a transaction, and waits for that some seconds."""
    try:
        yield
    except OperationalError as error:
        if getattr(error.orig, "sqlstate", None) != LOCK_NOT_AVAILABLE:
            raise
        text = "others work on the tables, nothing was changed; stop `serve`, `worker` and `beat`, then migrate again"
        raise RequestError("tables_in_use", text) from error


def refuse_unmigrated(settings: Settings) -> None:
    """`refuse_other_tables` at the start of a process that stays. A database that is away is waited for."""
    database = Database(settings.resolved_database_url)
    try:
        refuse_other_tables(database)
        _tell_of_no_writes(database)
    except DATABASE_AWAY as error:
        log.warning("the database cannot be used yet, it is waited for: %s", getattr(error, "orig", None) or error)
    finally:
        database.close()


def _tell_of_no_writes(database: Database) -> None:
    if database.takes_writes() is False:
        log.error("the database takes no writes: pages can be read, nothing is stored; `loopaudit doctor` says more")


def refuse_other_tables(database: Database) -> None:
    """Raises RequestError("no_tables"), ("older_tables") or ("newer_tables") where these are not this version's."""
    newest = schema.newest_revision()  # first: what was there at the start is to be known where the database is away
    current = schema.current_revision(database)
    refuse_newer(current)
    if current is None:
        raise RequestError("no_tables", "the database has no tables; run `loopaudit migrate`")
    if current != newest:
        text = f"the tables have version {current}, and this program needs {newest}; run `loopaudit migrate`"
        raise RequestError("older_tables", text)


def refuse_newer(current: str | None) -> None:
    if current is not None and not schema.is_known(current):
        text = f"the tables have version {current}, which this program does not know: a newer loopaudit made them. "
        text += "Run that one, or restore the backup from before it, on PostgreSQL into an empty database"
        raise RequestError("newer_tables", text)


def newer_than_we(database: Database) -> RequestError | None:
    """What `refuse_newer` says of these tables, for a process that stays and was there before them; None where they are
    ours, or the database does not answer."""
    try:
        refuse_newer(schema.current_revision(database))
    except DATABASE_AWAY:
        return None
    except RequestError as error:
        return error
    return None


def refuse_missing(settings: Settings) -> None:
    """Raises RequestError("no_database") where the file of an SQLite database is not there: reading makes none."""
    for file in database_files(settings):
        if not file.is_file():
            where = f"{file.parent} ({file.name})"
            text = f"there is no database in {where}; is LOOPAUDIT_DATA_DIR the folder of the service?"
            makes = "serve" if settings.embedded else "migrate"
            raise RequestError("no_database", f"{text} `loopaudit {makes}` makes one")


def refuse_unmounted(settings: Settings) -> None:
    """Raises RequestError("not_mounted") where an SQLite database would be made below a mount that is away: it would be
    gone from sight with the return of that one, on which the plant's own database is."""
    for file in database_files(settings):
        if place := place_away(file):
            text = f"there is no database in {file.parent.absolute()}, and {place}, which {FSTAB} names, is not mounted"
            raise RequestError("not_mounted", f"{text}: mount it first")


def database_files(settings: Settings) -> tuple[Path, ...]:
    """The file of an SQLite database; none of a server's."""
    database = Database(settings.resolved_database_url)
    database.close()
    return (file_of(database.url),) if database.is_sqlite else ()
