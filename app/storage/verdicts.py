"""Verdicts: written once a loop and run, read as the plant's table and as a loop's history."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import zstandard
from sqlalchemy import ColumnElement, Connection, Select, and_, func, or_, select, update

from app.storage.series import insert_new
from app.storage.tables import loops, verdict_details, verdicts

KEPT_FROM_USERS = ("loop_id", "input_start_ns", "input_end_ns", "extra_json")
ROW = [verdicts.c[column.name] for column in verdicts.columns if column.name not in KEPT_FROM_USERS]
SORTABLE = {column.name: column for column in ROW} | {
    "loop": loops.c.tag,
    "unit": loops.c.unit,
    "type": loops.c.type,
    "importance": loops.c.importance,
}
LONGEST_DETAIL = 64 << 20


@dataclass(frozen=True)
class RowFilter:
    """Which rows of the table: all that are given must hold."""

    verdict: tuple[str, ...] | None = None
    reliability: str | None = None
    unit: str | None = None
    type: str | None = None
    likely_cause: str | None = None
    table2_reading: str | None = None
    min_probability: float | None = None
    audit_id: int | None = None
    search: str | None = None


@dataclass(frozen=True)
class After:
    """The last row of a page: its sort value and its tag."""

    value: Any
    tag: str


@dataclass(frozen=True)
class NewVerdict:
    """A verdict to be stored: the row's columns and its packed detail."""

    loop_id: int
    audit_id: int
    columns: dict[str, Any]
    detail: bytes


def add(connection: Connection, new: Sequence[NewVerdict]) -> None:
    """Stores verdicts and points their loops at them; to be called in the transaction that ends the items."""
    if not new:
        return
    rows = [{"loop_id": v.loop_id, "audit_id": v.audit_id, **v.columns} for v in new]
    connection.execute(insert_new(connection, verdicts), rows)
    details = [{"loop_id": v.loop_id, "audit_id": v.audit_id, "packed": v.detail} for v in new]
    connection.execute(insert_new(connection, verdict_details), details)
    newest = max(v.audit_id for v in new)
    older = or_(loops.c.newest_audit_id.is_(None), loops.c.newest_audit_id < newest)
    ids = sorted(v.loop_id for v in new)
    # In one order, as uploads lock loops too: two writers that each wait for the other would both be thrown back.
    connection.execute(
        select(loops.c.id).where(loops.c.id.in_(ids)).order_by(loops.c.id).with_for_update(key_share=True)
    )
    connection.execute(update(loops).where(loops.c.id.in_(ids), older).values(newest_audit_id=newest))


def pack_detail(detail: dict[str, Any]) -> bytes:
    return zstandard.ZstdCompressor(3).compress(json.dumps(detail, separators=(",", ":")).encode())


def table(
    connection: Connection, limit: int, sort: str, descending: bool, wanted: RowFilter, after: After | None
) -> list[dict[str, Any]]:
    """One row a loop, its newest verdict (or that of one run): sorted, unknown values last, after the row `after`."""
    column = SORTABLE[sort]
    query = _rows(wanted).where(*_conditions(wanted))
    if after is not None:
        query = query.where(_beyond(column, descending, after))
    ordered = column.desc() if descending else column.asc()
    query = query.order_by(ordered.nulls_last(), loops.c.tag).limit(limit)
    return [_dict(row) for row in connection.execute(query).mappings()]


def newest(connection: Connection, loop_id: int) -> dict[str, Any] | None:
    """The newest verdict of a loop, by its key."""
    query = _rows(RowFilter()).where(loops.c.id == loop_id)
    row = connection.execute(query).mappings().one_or_none()
    return None if row is None else _dict(row)


def history(connection: Connection, loop_id: int, limit: int, before_audit: int | None) -> list[dict[str, Any]]:
    """A loop's verdicts, the newest first."""
    query = _select().join(loops, loops.c.id == verdicts.c.loop_id).where(verdicts.c.loop_id == loop_id)
    if before_audit is not None:
        query = query.where(verdicts.c.audit_id < before_audit)
    query = query.order_by(verdicts.c.audit_id.desc()).limit(limit)
    return [_dict(row) for row in connection.execute(query).mappings()]


def detail(connection: Connection, loop_id: int, audit_id: int) -> dict[str, Any] | None:
    query = select(verdict_details.c.packed)
    packed = connection.scalar(
        query.where(verdict_details.c.loop_id == loop_id, verdict_details.c.audit_id == audit_id)
    )
    if packed is None:
        return None
    return json.loads(zstandard.ZstdDecompressor().decompress(packed, max_output_size=LONGEST_DETAIL))


def counts(connection: Connection, by: Sequence[str]) -> list[tuple[Any, ...]]:
    """How many loops share each set of newest values of the columns `by`: the values, then the count."""
    columns = [SORTABLE[name] for name in by]
    query = select(*columns, func.count()).select_from(_newest_of_loops()).group_by(*columns)
    return [tuple(row) for row in connection.execute(query)]


def _rows(wanted: RowFilter) -> Select[Any]:
    if wanted.audit_id is not None:
        joined = verdicts.join(loops, loops.c.id == verdicts.c.loop_id)
        return _select().select_from(joined).where(verdicts.c.audit_id == wanted.audit_id)
    return _select().select_from(_newest_of_loops())


def _select() -> Select[Any]:
    return select(loops.c.tag, loops.c.unit, loops.c.type, loops.c.importance, verdicts.c.extra_json, *ROW)


def _newest_of_loops() -> Any:
    newest_one = and_(verdicts.c.loop_id == loops.c.id, verdicts.c.audit_id == loops.c.newest_audit_id)
    return loops.join(verdicts, newest_one)


def _conditions(wanted: RowFilter) -> list[ColumnElement[bool]]:
    conditions: list[ColumnElement[bool]] = []
    if wanted.verdict is not None:
        conditions.append(verdicts.c.verdict.in_(wanted.verdict))
    for name in ("reliability", "unit", "type", "likely_cause", "table2_reading"):
        value = getattr(wanted, name)
        if value is not None:
            conditions.append(SORTABLE[name] == value)
    if wanted.min_probability is not None:
        conditions.append(verdicts.c.stiction_probability >= wanted.min_probability)
    if wanted.search:
        conditions.append(loops.c.tag.icontains(wanted.search, autoescape=True))
    return conditions


def _beyond(column: ColumnElement[Any], descending: bool, after: After) -> ColumnElement[bool]:
    """Rows after `after` in the order of `table`: by value, unknown ones last, then by tag."""
    if after.value is None:
        return and_(column.is_(None), loops.c.tag > after.tag)
    further = column < after.value if descending else column > after.value
    return or_(further, and_(column == after.value, loops.c.tag > after.tag), column.is_(None))


def _dict(row: Any) -> dict[str, Any]:
    values = dict(row)
    return values | json.loads(values.pop("extra_json"))
