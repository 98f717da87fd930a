"""The schema's versions: brings a data base to the newest one, and says which one it has."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection

from app.storage.database import Database
from app.storage.locks import Lock, hold


def migrate(database: Database, revision: str = "head") -> None:
    """Brings the data base to `revision`; nothing happens where it is there already."""
    with _configured(database) as config:
        command.upgrade(config, revision)


def downgrade(database: Database, revision: str) -> None:
    with _configured(database) as config:
        command.downgrade(config, revision)


def bring_to(database: Database, revision: str) -> None:
    """Up or down to `revision`, one that is known; a data base without tables stays as it is."""
    versions = _versions()
    current = current_revision(database)
    if current is None or current == revision:
        return
    step = migrate if current in versions and versions.index(current) < versions.index(revision) else downgrade
    step(database, revision)


def is_known(revision: str) -> bool:
    """Whether this program has the migration that makes these tables."""
    return revision in _versions()


def current_revision(database: Database) -> str | None:
    with database.read() as connection:
        return MigrationContext.configure(connection).get_current_revision()


def newest_revision() -> str:
    return _versions()[-1]


@contextmanager
def _configured(database: Database) -> Iterator[Config]:
    with database.writer.connect() as connection, connection.begin():
        _prepare(connection)
        config = _config()
        config.attributes["connection"] = connection
        yield config


def _prepare(connection: Connection) -> None:
    """One migration at a time, and none that waits for a lock while everybody else waits behind it."""
    if connection.dialect.name == "postgresql":
        connection.exec_driver_sql("SET LOCAL statement_timeout = 0")
        connection.exec_driver_sql("SET LOCAL lock_timeout = '60s'")
        hold(connection, Lock.MIGRATING)
        connection.exec_driver_sql("SET LOCAL lock_timeout = '5s'")


@cache
def _versions() -> list[str]:
    """All revisions, the oldest first: those that were there when this process first asked, whatever source is put in
    the place of its own."""
    return [script.revision for script in ScriptDirectory.from_config(_config()).walk_revisions()][::-1]


def _config() -> Config:
    config = Config()
    config.set_main_option("script_location", str(Path(str(files("migrations")))).replace("%", "%%"))
    return config
