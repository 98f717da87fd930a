"""Whether a database is sound, and in use."""

import time
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, literal, select, text

from app.storage.database import journal_mode
from app.storage.tables import keys, loops, uploads
from app.storage.types import clock_s


@dataclass(frozen=True)
class Integrity:
    """Of an SQLite file. damaged: what its own check found first (None: nothing); broken: a row that names one that is
    not there: table, number, table of the other, which reference (None: there is none, or the file is damaged)."""

    journal_mode: str
    damaged: str | None
    broken: Any

    @property
    def unsafe(self) -> bool:
        """Whether it is written ahead by an SQLite that may lose data by that."""
        return self.journal_mode == "wal" and journal_mode() != "WAL"


def integrity(connection: Connection) -> Integrity:
    mode = connection.exec_driver_sql("PRAGMA journal_mode").scalar()
    found = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar()
    if found != "ok":
        return Integrity(str(mode), str(found), None)
    return Integrity(str(mode), None, connection.exec_driver_sql("PRAGMA foreign_key_check").first())


def clock_difference_s(connection: Connection) -> float:
    """How far the clock of this machine and that of the database are apart."""
    return abs(float(connection.scalar(select(clock_s())) or 0.0) - time.time())


def in_use(connection: Connection) -> bool:
    """Whether a plant has begun to use these tables."""
    begun = (select(literal(1)).select_from(table).limit(1) for table in (loops, uploads, keys))
    return any(connection.scalar(query) is not None for query in begun)


PROBED_MB = 4


def try_to_grow(connection: Connection) -> None:
    """Has PostgreSQL write PROBED_MB more than its files hold, in a table that is gone when this returns; what its log
    of writes has room for is not tried. Raises what SQLAlchemy raises where it cannot."""
    connection.exec_driver_sql("SET LOCAL temp_tablespaces = ''")  # where the database has its own files
    connection.exec_driver_sql("CREATE TABLE pg_temp.loopaudit_room (filler text)")
    rows = "SELECT repeat('x', 1000) FROM generate_series(1, :rows)"  # too short to be packed
    connection.execute(text(f"INSERT INTO pg_temp.loopaudit_room {rows}"), {"rows": 1000 * PROBED_MB})
    connection.rollback()
