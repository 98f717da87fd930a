"""The schema's versions: brings a database to the newest one, and says which one it has."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import Connection, column, select, table

from app.storage.database import Database
from app.storage.locks import Lock, hold

if TYPE_CHECKING:
    from alembic.config import Config

VERSION = table("alembic_version", column("version_num"))
MODULE_OF_A_REVISION = re.compile(r"v(\d{4})_\w+\.py")


def migrate(database: Database, revision: str = "head") -> None:
    """Brings the database to `revision`; nothing happens where it is there already."""
    if revision == "head" and current_revision(database) == newest_revision():
        return
    from alembic import command  # a fifth of the start of a command, and most of them find the newest version

    with _configured(database) as config:
        command.upgrade(config, revision)


def downgrade(database: Database, revision: str) -> None:
    from alembic import command  # as above

    with _configured(database) as config:
        command.downgrade(config, revision)


def bring_to(database: Database, revision: str) -> None:
    """Up or down to `revision`, one that is known; a database without tables stays as it is."""
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
    """None: of a database without tables."""
    with database.read() as connection:
        if not connection.dialect.has_table(connection, VERSION.name):
            return None
        return connection.execute(select(VERSION.c.version_num)).scalar_one_or_none()


def newest_revision() -> str:
    return _versions()[-1]


@contextmanager
def _configured(database: Database) -> Iterator["Config"]:
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
    return _listed()


def _listed() -> list[str]:
    """By the names of their modules: to read these takes as long as to open a database."""
    modules = (MODULE_OF_A_REVISION.fullmatch(path.name) for path in (files("migrations") / "versions").iterdir())
    return sorted(module[1] for module in modules if module)


def _config() -> "Config":
    from alembic.config import Config  # as above

    config = Config()
    config.set_main_option("script_location", str(Path(str(files("migrations")))).replace("%", "%%"))
    return config
