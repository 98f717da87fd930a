"""Inserts in the words of both databases, and many rows in one statement: PostgreSQL takes columns as arrays in one
round trip; rows one by one cost one each."""

import json
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

from sqlalchemy import ColumnElement, Connection, Insert, Select, Table, any_, bindparam, func, select
from sqlalchemy.dialects import postgresql, sqlite

Rows = Sequence[dict[str, Any]]


def insert_for(connection: Connection, table: Any) -> Any:
    """An insert that can say what to do where a row's key is there already."""
    dialect = postgresql if connection.dialect.name == "postgresql" else sqlite
    return dialect.insert(table)


def insert_new(connection: Connection, table: Any) -> Insert:
    """An insert that leaves rows alone whose key is there already."""
    return insert_for(connection, table).on_conflict_do_nothing()


def insert_new_rows(connection: Connection, table: Table, rows: Rows) -> None:
    """Inserts rows of the same columns; rows whose key is there already are left alone."""
    if connection.dialect.name != "postgresql":
        connection.execute(sqlite.insert(table).on_conflict_do_nothing(), list(rows))
    else:
        connection.execute(_insert(table, tuple(rows[0])), columns_of(rows))


def among(connection: Connection, column: ColumnElement[Any], values: Iterable[Any]) -> ColumnElement[bool]:
    """Whether the column has one of the values, which PostgreSQL takes as one array, however many there are."""
    listed = list(values)
    if connection.dialect.name != "postgresql":
        return column.in_(listed)
    return column == any_(bindparam(None, listed, type_=postgresql.ARRAY(column.type), unique=True))


def among_many(connection: Connection, column: ColumnElement[Any], values: Iterable[Any]) -> ColumnElement[bool]:
    """The same of a whole plant's numbers or texts: SQLite takes so many in a statement, and no more."""
    if connection.dialect.name == "postgresql":
        return among(connection, column, values)
    return column.in_(select(func.json_each(json.dumps(list(values))).table_valued("value").c.value))


def from_arrays(table: Table, names: Sequence[str]) -> Select[Any]:
    """The rows that `columns_of` was given, on PostgreSQL; their types are those of the table's columns."""
    arrays = (bindparam(f"sent_{name}", type_=postgresql.ARRAY(table.c[name].type)) for name in names)
    return select(*(func.unnest(array).label(name) for name, array in zip(names, arrays, strict=True)))


def from_json(names: Sequence[str]) -> Select[Any]:
    """The same on SQLite, of rows of numbers that `sent_rows` has as JSON: a list of lists, in the order of `names`."""
    row = func.json_each(bindparam("sent_rows")).table_valued("value").c.value
    return select(*(func.json_extract(row, f"$[{at}]").label(name) for at, name in enumerate(names)))


def columns_of(rows: Rows) -> dict[str, list[Any]]:
    return {f"sent_{name}": [row[name] for row in rows] for name in rows[0]}


@lru_cache(maxsize=64)
def _insert(table: Table, names: tuple[str, ...]) -> Insert:
    statement = postgresql.insert(table).from_select(list(names), from_arrays(table, names))
    return statement.on_conflict_do_nothing()
