"""Plants that many tests begin with are made once for each database, and their rows are laid down anew each time: to
audit four loops twice takes a tenth of a second, to write what that left a hundredth.
"""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from copy import deepcopy
from dataclasses import dataclass

import psycopg
from psycopg import sql

from app.services.backend import Backend
from app.sqlite_files import file_of
from app.storage.tables import metadata

NUMBERS = "SELECT sequencename, last_value FROM pg_sequences WHERE schemaname = 'public' AND last_value IS NOT NULL"


@dataclass(frozen=True)
class _Rows:
    """All rows of PostgreSQL, by table, parents first, and how far its numbers have come."""

    tables: dict[str, bytes]
    numbers: dict[str, int]


_kept: dict[tuple[str, str], tuple[object, sqlite3.Connection | _Rows]] = {}


def made_once(backend: Backend, name: str, make: Callable[[], object]) -> object:
    """What `make` gives, and in the empty database of this backend the rows that it leaves there; it may depend on
    nothing but its name. Files are not kept.
    """
    key = (backend.database.url.get_backend_name(), name)
    if key in _kept:
        given, rows = _kept[key]
        _lay_down(backend, rows)
        return deepcopy(given)
    given = make()
    _kept[key] = deepcopy(given), _taken_up(backend)
    return given


def _taken_up(backend: Backend) -> sqlite3.Connection | _Rows:
    if backend.database.is_sqlite:
        rows = sqlite3.connect(":memory:", check_same_thread=False)
        with closing(sqlite3.connect(file_of(backend.database.url))) as file:
            file.backup(rows)
        return rows
    with _connected(backend) as connection:
        tables = {table.name: _copied(connection, table.name) for table in metadata.sorted_tables}
        return _Rows(
            {name: rows for name, rows in tables.items() if rows}, dict(connection.execute(NUMBERS).fetchall())
        )


def _copied(connection: psycopg.Connection, table: str) -> bytes:
    with connection.cursor().copy(sql.SQL("COPY {} TO STDOUT").format(sql.Identifier(table))) as copy:
        return b"".join(copy)


def _lay_down(backend: Backend, rows: sqlite3.Connection | _Rows) -> None:
    if isinstance(rows, sqlite3.Connection):
        with closing(sqlite3.connect(file_of(backend.database.url))) as file:
            rows.backup(file)
        return
    with _connected(backend) as connection:
        for table, copied in rows.tables.items():
            with connection.cursor().copy(sql.SQL("COPY {} FROM STDIN").format(sql.Identifier(table))) as copy:
                copy.write(copied)
        for name, number in rows.numbers.items():
            connection.execute("SELECT setval(%s, %s)", (name, number))


def _connected(backend: Backend) -> psycopg.Connection:
    return psycopg.connect(str(backend.settings.database_url).replace("+psycopg", ""))
