"""Verdicts as they are written: once a loop and run, and in other words where a run's end has heard of other loops."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from sqlalchemy import Connection, Insert, Table, bindparam, case, or_, select, update
from sqlalchemy.dialects import postgresql, sqlite

from app.storage.asked_rows import KEPT
from app.storage.bulk import Rows, among, columns_of, from_arrays, insert_new_rows
from app.storage.tables import loops, newest_rows, verdict_details, verdicts

BESIDE = (*KEPT, "audited_at", "window_end", "input_end_ns")
"""Columns of a verdict that its loop's newest row has too."""


@dataclass(frozen=True)
class NewVerdict:
    """A verdict to be stored: the row's columns, its packed detail, and the row as it will be sent, in the form `form`.

    The whole table is 14,000 rows of fifty fields: writing each as JSON once, where it is made, is what lets it be
    answered at once.
    """

    loop_id: int
    audit_id: int
    columns: dict[str, Any]
    detail: bytes
    row_json: str
    figures_json: str
    form: str
    swing_json: str | None = None
    excerpts_json: str | None = None


@dataclass(frozen=True)
class Reworded:
    """A verdict that is stored, and what of it is to be other than it was."""

    loop_id: int
    audit_id: int
    columns: dict[str, Any]
    detail: bytes
    row_json: str


def add(connection: Connection, new: Sequence[NewVerdict]) -> None:
    """Stores verdicts of a run and points their loops at them; to be called in the transaction that ends the items."""
    if not new:
        return
    rows = [{"loop_id": v.loop_id, "audit_id": v.audit_id, **v.columns} for v in new]
    insert_new_rows(connection, verdicts, rows)
    details = [{"loop_id": v.loop_id, "audit_id": v.audit_id, "packed": v.detail} for v in new]
    insert_new_rows(connection, verdict_details, details)
    newest = max(v.audit_id for v in new)
    older = or_(loops.c.newest_audit_id.is_(None), loops.c.newest_audit_id < newest)
    these = among(connection, loops.c.id, [v.loop_id for v in new])
    # In one order, as uploads lock loops too: two writers that each wait for the other would both be thrown back.
    connection.execute(select(loops.c.id).where(these).order_by(loops.c.id).with_for_update(key_share=True))
    connection.execute(update(loops).where(these, older).values(newest_audit_id=newest))
    _keep_rows(connection, new)


def _keep_rows(connection: Connection, new: Sequence[NewVerdict]) -> None:
    """One row a loop, that of its newest run; one statement writes a row once."""
    rows = {
        v.loop_id: {"loop_id": v.loop_id, "audit_id": v.audit_id}
        | {"form": v.form, "row_json": v.row_json, "figures_json": v.figures_json}
        | {"swing_json": v.swing_json, "excerpts_json": v.excerpts_json}
        | {name: v.columns[name] for name in BESIDE}
        for v in sorted(new, key=lambda v: v.loop_id)
    }
    _keep(connection, list(rows.values()))


def _keep(connection: Connection, rows: Rows) -> None:
    together = connection.dialect.name == "postgresql"
    connection.execute(_keeping(tuple(rows[0]), together), columns_of(rows) if together else list(rows))


@lru_cache(maxsize=4)
def _keeping(names: tuple[str, ...], together: bool) -> Insert:
    """together: of rows as `columns_of` has them, on PostgreSQL; else row by row."""
    insert = postgresql.insert(newest_rows) if together else sqlite.insert(newest_rows)
    keeping: Any = insert.from_select(list(names), from_arrays(newest_rows, names)) if together else insert
    written = {name: keeping.excluded[name] for name in names if name != "loop_id"}
    newer = keeping.excluded.audit_id > newest_rows.c.audit_id
    before = {
        "before_audit_id": case((newer, newest_rows.c.audit_id), else_=newest_rows.c.before_audit_id),
        "verdict_before": case((newer, newest_rows.c.verdict), else_=newest_rows.c.verdict_before),
    }
    return keeping.on_conflict_do_update(
        index_elements=["loop_id"],
        set_=written | before,
        where=keeping.excluded.audit_id >= newest_rows.c.audit_id,
    )


def reword(connection: Connection, changed: Sequence[Reworded]) -> None:
    """Rewrites what these verdicts say, the same columns of all; to be called in the transaction that ends their run,
    because what has been read of a row is kept until then."""
    for table, values in (
        (verdicts, [one.columns for one in changed]),
        (verdict_details, [{"packed": one.detail} for one in changed]),
        (newest_rows, [{"row_json": one.row_json} | _kept(one.columns) for one in changed]),
    ):
        _rewrite(connection, table, changed, values)


def _kept(columns: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in columns.items() if name in BESIDE}


def _rewrite(
    connection: Connection, table: Table, changed: Sequence[Reworded], values: Sequence[Mapping[str, Any]]
) -> None:
    if not changed:
        return
    mine = (table.c.loop_id == bindparam("of_loop"), table.c.audit_id == bindparam("of_run"))
    statement = update(table).where(*mine).values({table.c[name]: bindparam(f"new_{name}") for name in values[0]})
    keys = [{"of_loop": one.loop_id, "of_run": one.audit_id} for one in changed]
    new = [{f"new_{name}": value for name, value in row.items()} for row in values]
    connection.execute(statement, [{**key, **row} for key, row in zip(keys, new, strict=True)])
