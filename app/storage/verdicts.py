"""Verdicts as they are read: as the plant's table, as a loop's history, and as what other loops have heard of them."""

import hashlib
import json
from collections.abc import Collection, Mapping, Sequence
from datetime import datetime
from functools import lru_cache
from typing import Any, NamedTuple

from sqlalchemy import (
    ColumnElement,
    Connection,
    FromClause,
    Select,
    and_,
    func,
    select,
)

from app.json_texts import read_json
from app.storage.asked_rows import OF_RUN, QUICK, ROW, SORTABLE, After, Order, RowFilter, beyond, in_order, of_filter
from app.storage.bulk import among, among_many
from app.storage.database import in_driver
from app.storage.loops import IN_SERVICE, retired
from app.storage.newest import NEWEST_ROWS, NEWEST_VERDICTS, is_newest, unanswered
from app.storage.tables import audits, loops, newest_rows, verdicts

_OF_LOOPS = verdicts.join(loops, loops.c.id == verdicts.c.loop_id)
EXCERPTS_AT_ONCE = 500
ROWS_OF = "SELECT loop_id, audit_id, row_json FROM newest_rows WHERE form = %s AND loop_id = ANY(%s::bigint[])"


class SaidRow(NamedTuple):
    """What a verdict says in short, of which run it is, and what is stated of the loop's OP."""

    tag: str
    moves_valve: bool | None
    loop_id: int
    audit_id: int
    verdict: str
    reliability: str
    stiction_probability: float | None


class NewestSaid(NamedTuple):
    """What was said and when, and the first and last sample (ns since 1970) that it was made of."""

    verdict: str
    audited_at: datetime
    input_start_ns: int | None
    input_end_ns: int | None
    input_fingerprint: str


class SwingRow(NamedTuple):
    """unanswered: PV does not answer OP, so that the probability is none that was measured."""

    tag: str
    unit: str | None
    stiction_probability: float | None
    swing_json: str
    unanswered: bool | None


class ExcerptsRow(NamedTuple):
    loop_id: int
    tag: str
    excerpts_json: str


class InputRow(NamedTuple):
    """What was given to the engine for a verdict, from and to, and the window of it that was judged; None where it was
    not kept, or nothing was judged."""

    input_start_ns: int | None
    input_end_ns: int | None
    window_start: datetime | None
    window_end: datetime | None


class Settled(NamedTuple):
    """What tells a state of a run's rows from any other: when it was begun, and ended; None: not yet."""

    begun: datetime
    ended: datetime | None


class SentRow(NamedTuple):
    """A row of the table as it is known before it is read; `value` sorts it. of_loop: type, description, owner,
    importance and newest sample (ns) of its loop as it is now, where they are asked for."""

    loop_id: int
    audit_id: int
    tag: str
    unit: str | None
    value: Any
    of_loop: tuple[Any, ...] = ()

    @property
    def key(self) -> tuple[int, int]:
        return self.loop_id, self.audit_id


OF_LOOP = [loops.c[name] for name in ("type", "description", "owner", "importance", "newest_ns")]


def said(connection: Connection) -> list[SaidRow]:
    """Of the newest verdict of each loop in service."""
    told = (newest_rows.c[name] for name in SaidRow._fields[2:])
    query = select(loops.c.tag, loops.c.moves_valve, *told).select_from(NEWEST_ROWS)
    return [SaidRow._make(row) for row in connection.execute(query.where(IN_SERVICE).order_by(loops.c.tag))]


def table(
    connection: Connection, limit: int, order: Order, wanted: RowFilter, after: After | None
) -> list[dict[str, Any]]:
    """One row a loop, its newest verdict (or that of one run): sorted, unknown values last, after the row `after`.

    `sorted_by` of a row is the value that it was sorted by, which a newer verdict may have replaced in the row itself.
    """
    quick = wanted.audit_id is None and order.name in QUICK
    columns, key_table = (QUICK, newest_rows) if quick else (_of_verdicts(wanted), verdicts)
    # Keys are sorted alone: whole rows, with their texts, are fetched for those that are shown.
    keys = select(key_table.c.loop_id, key_table.c.audit_id, columns[order.name].label("sorted_by"))
    keys = keys.where(*of_filter(wanted, columns))
    keys = keys.select_from(NEWEST_ROWS if quick else _rows_of(wanted))
    if after is not None:
        keys = keys.where(beyond(columns[order.name], order, after))
    page = keys.order_by(*in_order(columns[order.name], order)).limit(limit).subquery()
    mine = and_(page.c.loop_id == verdicts.c.loop_id, page.c.audit_id == verdicts.c.audit_id)
    query = _select().add_columns(page.c.sorted_by).select_from(_with_run(page.join(_OF_LOOPS, mine)))
    query = query.order_by(*in_order(page.c.sorted_by, order))
    return [_dict(row) for row in connection.execute(query).mappings()]


def _of_verdicts(wanted: RowFilter) -> Mapping[str, ColumnElement[Any]]:
    return SORTABLE if wanted.audit_id is None else OF_RUN


def count(connection: Connection, wanted: RowFilter) -> int:
    """How many rows `table` has in all."""
    quick = wanted.audit_id is None
    query = select(func.count()).select_from(NEWEST_ROWS if quick else _rows_of(wanted))
    return connection.scalar(query.where(*of_filter(wanted, QUICK if quick else SORTABLE))) or 0


def count_beyond(connection: Connection, order: Order, wanted: RowFilter, after: After) -> int:
    """How many rows of `table` come after `after`."""
    beyond = _without_texts(order, wanted, after).order_by(None).subquery()
    return connection.scalar(select(func.count()).select_from(beyond)) or 0


def row_at(connection: Connection, order: Order, wanted: RowFilter, place: int) -> After | None:
    """The row of `table` behind so many others; None where there are not as many."""
    query = _without_texts(order, wanted, None).offset(place).limit(1)
    row = connection.execute(query).one_or_none()
    return None if row is None else After(SentRow(*row).value, row.tag)


def sent_rows(
    connection: Connection,
    limit: int,
    order: Order,
    wanted: RowFilter,
    after: After | None,
    of_loop: bool = False,
) -> list[SentRow]:
    """The rows of `table`, without what their verdicts say."""
    query = _without_texts(order, wanted, after).add_columns(*(OF_LOOP if of_loop else ()))
    return [SentRow._make((*row[:5], tuple(row[5:]))) for row in connection.execute(query.limit(limit))]


def _without_texts(order: Order, wanted: RowFilter, after: After | None) -> Select[Any]:
    """Of the newest verdicts only where the order asks for a column that is not kept beside their rows."""
    of_run = wanted.audit_id is not None
    known, keys = (OF_RUN, verdicts) if of_run else (QUICK, newest_rows)
    source = _rows_of(wanted) if of_run else NEWEST_ROWS
    if order.name not in known:
        source = source.join(verdicts, is_newest(verdicts))
    column, conditions = known.get(order.name, SORTABLE[order.name]), of_filter(wanted, known)
    if after is not None:
        conditions.append(beyond(column, order, after))
    query = select(loops.c.id, keys.c.audit_id, loops.c.tag, loops.c.unit, column).select_from(source)
    return query.where(*conditions).order_by(*in_order(column, order))


def of_keys(connection: Connection, keys: Sequence[tuple[int, int]]) -> dict[tuple[int, int], dict[str, Any]]:
    """Verdicts by loop and run; one that is gone is left out."""
    if not keys:
        return {}
    query = _select().add_columns(verdicts.c.loop_id).select_from(_with_run(_OF_LOOPS))
    found: dict[tuple[int, int], dict[str, Any]] = {}
    for run in sorted({audit_id for _, audit_id in keys}):  # one, most often; as pairs they took ten times as long
        mine = among_many(connection, verdicts.c.loop_id, [loop_id for loop_id, of_run in keys if of_run == run])
        rows = connection.execute(query.where(mine, verdicts.c.audit_id == run)).mappings()
        found |= {(row["loop_id"], run): _dict(row) for row in rows}
    return found


def texts(connection: Connection, loop_ids: Sequence[int], form: str) -> dict[tuple[int, int], bytes]:
    """The stored JSON of the loops' newest rows, by loop and run, where it is of this form. Bytes as they are stored:
    40 MB of text are not taken apart and put together again."""
    if connection.dialect.name == "postgresql":
        with in_driver(connection) as driver, driver.cursor() as cursor:
            cursor.adapters.register_loader("text", _as_bytes())
            cursor.execute(ROWS_OF, (form, list(loop_ids)))
            return {(loop_id, audit_id): text for loop_id, audit_id, text in cursor.fetchall()}
    told = (newest_rows.c.loop_id, newest_rows.c.audit_id, newest_rows.c.row_json)
    query = select(*told).where(newest_rows.c.form == form, among_many(connection, newest_rows.c.loop_id, loop_ids))
    return {(loop_id, audit_id): text.encode() for loop_id, audit_id, text in connection.execute(query)}


def settled(connection: Connection, audit_ids: Collection[int]) -> dict[int, Settled]:
    """When each of these runs was begun, and ended, for then its rows may be reworded. After a restore the number of a
    run may come again, with other times."""
    if not audit_ids:
        return {}
    query = select(audits.c.id, audits.c.created_at, audits.c.ended_at)
    found = connection.execute(query.where(audits.c.id.between(min(audit_ids), max(audit_ids))))
    return {run.id: Settled(run.created_at, run.ended_at) for run in found if run.id in audit_ids}


@lru_cache(maxsize=1)
def _as_bytes() -> Any:
    from psycopg.adapt import Loader  # an extra: there is no PostgreSQL without it

    class AsBytes(Loader):
        def load(self, data: Any) -> bytes:
            return bytes(data)

    return AsBytes


def sent_health(connection: Connection, tag: str, form: str) -> tuple[str, str, str | None] | None:
    """Row and key figures of a loop's newest verdict as they are sent, and its unit; None where there is none in this
    form."""
    query = select(newest_rows.c.row_json, newest_rows.c.figures_json, loops.c.unit).select_from(NEWEST_ROWS)
    row = connection.execute(query.where(loops.c.tag == tag, newest_rows.c.form == form)).one_or_none()
    return None if row is None else (row[0], row[1], row[2])


def newest_of(connection: Connection, loop_ids: Sequence[int]) -> dict[str, dict[str, Any]]:
    """The newest verdicts of these loops by tag; a loop without one is left out."""
    query = _select().select_from(_with_run(NEWEST_VERDICTS)).where(loops.c.id.in_(loop_ids))
    found = connection.execute(query).mappings()
    return {row["tag"]: _dict(row) for row in found}


def newest(connection: Connection, tag: str) -> tuple[int, dict[str, Any] | None] | None:
    """The key of the loop with this tag and its newest verdict, if it has one, in one query; None without the loop."""
    source = _with_run(loops.outerjoin(verdicts, is_newest(verdicts)), outer=True)
    query = _select().add_columns(loops.c.id).select_from(source)
    row = connection.execute(query.where(loops.c.tag == tag)).mappings().one_or_none()
    if row is None:
        return None
    return row["id"], None if row["audit_id"] is None else _dict(row)


def newest_said(connection: Connection, loop_id: int) -> NewestSaid | None:
    """Of the loop's newest verdict; None where there is none."""
    query = select(*(verdicts.c[name] for name in NewestSaid._fields)).join(loops, is_newest(verdicts))
    row = connection.execute(query.where(loops.c.id == loop_id)).one_or_none()
    return None if row is None else NewestSaid._make(row)


def fingerprint_before(connection: Connection, loop_id: int, at: datetime) -> str | None:
    """Of what the loop's newest verdict of before that time rests on; None where there was none."""
    query = select(verdicts.c.input_fingerprint).where(verdicts.c.loop_id == loop_id, verdicts.c.audited_at <= at)
    return connection.scalar(query.order_by(verdicts.c.audit_id.desc()).limit(1))


def history(connection: Connection, loop_id: int, limit: int, before_audit: int | None) -> list[dict[str, Any]]:
    """A loop's verdicts, the newest first."""
    query = _select().select_from(_with_run(_OF_LOOPS)).where(verdicts.c.loop_id == loop_id)
    if before_audit is not None:
        query = query.where(verdicts.c.audit_id < before_audit)
    query = query.order_by(verdicts.c.audit_id.desc()).limit(limit)
    return [_dict(row) for row in connection.execute(query).mappings()]


def of_runs(connection: Connection, loop_id: int, audit_ids: Collection[int]) -> dict[int, dict[str, Any]]:
    """A loop's verdicts of these runs, by run; one that it has none of is left out."""
    query = _select().select_from(_with_run(_OF_LOOPS))
    mine = (verdicts.c.loop_id == loop_id, verdicts.c.audit_id.in_(audit_ids))
    return {row["audit_id"]: _dict(row) for row in connection.execute(query.where(*mine)).mappings()}


def input_of(connection: Connection, loop_id: int, audit_id: int) -> InputRow | None:
    """What was given to the engine and what it used of it; None without such a verdict."""
    columns = [verdicts.c[name] for name in InputRow._fields]
    mine = (verdicts.c.loop_id == loop_id, verdicts.c.audit_id == audit_id)
    row = connection.execute(select(*columns).where(*mine)).one_or_none()
    return None if row is None else InputRow._make(row)


def swings(connection: Connection) -> list[SwingRow]:
    """What is kept of the oscillations of all loops in service whose newest verdict saw one."""
    told = (newest_rows.c.stiction_probability, newest_rows.c.swing_json, unanswered(newest_rows))
    query = select(loops.c.tag, loops.c.unit, *told).select_from(NEWEST_ROWS)
    seen = newest_rows.c.swing_json.is_not(None)
    return [SwingRow._make(row) for row in connection.execute(query.where(seen, IN_SERVICE).order_by(loops.c.tag))]


def excerpts(connection: Connection, after: int = 0) -> list[ExcerptsRow]:
    """What is kept of OP and SP of loops in service in which one of them moves, in the order of their ids: of the first
    ones behind `after`. Of a plant it is 30 MB of text, which a driver may hold twice."""
    columns = (loops.c.id, loops.c.tag, newest_rows.c.excerpts_json)
    kept = newest_rows.c.excerpts_json.is_not(None)
    query = select(*columns).select_from(NEWEST_ROWS).where(kept, IN_SERVICE, loops.c.id > after)
    rows = connection.execute(query.order_by(loops.c.id).limit(EXCERPTS_AT_ONCE))
    return [ExcerptsRow._make(row) for row in rows]


def newest_state(connection: Connection) -> tuple[Any, ...]:
    """Changes whenever a loop gets a newer verdict, another unit, or is retired."""
    query = select(func.max(loops.c.newest_audit_id), func.sum(loops.c.newest_audit_id), func.count())
    units = select(func.coalesce(loops.c.unit, "").label("unit")).order_by(loops.c.id).subquery()
    together = connection.scalar(select(func.aggregate_strings(units.c.unit, "\n"))) or ""  # one row, not 14,000
    told = hashlib.blake2b(together.encode(), digest_size=8).digest()
    return (*connection.execute(query).one(), told, retired(connection))


def extras(connection: Connection, loop_ids: Collection[int], audit_id: int) -> dict[int, dict[str, Any]]:
    """Of one run, by loop: the fields of its row without a column of their own, with what is kept beside them."""
    query = select(verdicts.c.loop_id, verdicts.c.extra_json)
    mine = (among(connection, verdicts.c.loop_id, loop_ids), verdicts.c.audit_id == audit_id)
    return {loop_id: json.loads(extra) for loop_id, extra in connection.execute(query.where(*mine))}


def _rows_of(wanted: RowFilter) -> Any:
    """Loops with the verdict that is asked for: that of a run, or their newest one."""
    if wanted.audit_id is None:
        return NEWEST_VERDICTS
    mine = and_(loops.c.id == verdicts.c.loop_id, verdicts.c.audit_id == wanted.audit_id)
    return verdicts.join(loops, mine)


def _select() -> Select[Any]:
    of_loop = [SORTABLE[name] for name in ("unit", "type", "owner", "importance", "recorded_to", "priority")]
    of_run = (audits.c.created_at.label("run_begun"), audits.c.newest_ns.label("run_newest_ns"))
    of_input = (verdicts.c.input_start_ns, verdicts.c.input_end_ns)
    return select(loops.c.tag, loops.c.description, *of_loop, *of_run, *of_input, verdicts.c.extra_json, *ROW)


def _with_run(said: FromClause, *, outer: bool = False) -> FromClause:
    """Verdicts with the runs that they are of."""
    return said.join(audits, audits.c.id == verdicts.c.audit_id, isouter=outer)


def _dict(row: Any) -> dict[str, Any]:
    values = dict(row)
    return values | read_json(values.pop("extra_json"))
