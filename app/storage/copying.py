"""All rows of one database into another of the other kind, table by table, in the order in which they lean on each
other."""

from collections.abc import Iterator
from itertools import islice
from typing import Any

from sqlalchemy import Connection, LargeBinary, Table, Text, func, insert, select, text

from app.storage.tables import metadata
from app.storage.types import storable

ROWS_AT_ONCE, PACKED_ROWS_AT_ONCE = 500, 16
"""The latter of tables with packed samples: a row may have megabytes."""


def copy_rows(source: Connection, target: Connection) -> int:
    """How many rows were copied. Both have the newest tables, those of `target` without rows."""
    return sum(_copy_table(source, target, table) for table in metadata.sorted_tables)


def empty(connection: Connection) -> None:
    """Takes all rows out of all tables of a PostgreSQL database."""
    names = ", ".join(table.name for table in metadata.sorted_tables)
    connection.execute(text(f"TRUNCATE {names} RESTART IDENTITY CASCADE"))


def _copy_table(source: Connection, target: Connection, table: Table) -> int:
    texts = [column.name for column in table.columns if isinstance(column.type, Text)]
    packed = any(isinstance(column.type, LargeBinary) for column in table.columns)
    at_once, copied = PACKED_ROWS_AT_ONCE if packed else ROWS_AT_ONCE, 0
    with source.execution_options(yield_per=at_once).execute(select(table)) as rows:
        told = _storable(rows.mappings(), texts)
        while some := list(islice(told, at_once)):
            target.execute(insert(table), some)
            copied += len(some)
    if table.autoincrement_column is not None and copied:
        _number_on(target, table, table.autoincrement_column.name)
    return copied


def _storable(rows: Any, texts: list[str]) -> Iterator[dict[str, Any]]:
    for row in rows:
        yield {**row, **{name: storable(row[name]) for name in texts if row[name] is not None}}


def _number_on(target: Connection, table: Table, key: str) -> None:
    """New rows are numbered behind those that were copied."""
    last = select(func.max(table.c[key])).scalar_subquery()
    target.execute(select(func.setval(func.pg_get_serial_sequence(table.name, key), last)))
