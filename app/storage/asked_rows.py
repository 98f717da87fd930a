"""Which rows of the table of verdicts are asked for, and in what order they come."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from sqlalchemy import BigInteger, ColumnElement, and_, or_

from app.storage.loops import IN_SERVICE, found_by
from app.storage.newest import of_cause, priority
from app.storage.notes import has_open_order
from app.storage.tables import loops, newest_rows, verdicts
from app.storage.word_order import by_words

KEPT_FROM_USERS = ("loop_id", "input_start_ns", "input_end_ns", "extra_json")
ROW = [verdicts.c[column.name] for column in verdicts.columns if column.name not in KEPT_FROM_USERS]
SORTABLE = {column.name: column for column in ROW if column.name != "reasons_text"} | {
    "loop": loops.c.tag,
    "unit": loops.c.unit,
    "type": loops.c.type,
    "owner": loops.c.owner,
    "importance": loops.c.importance,
    "recorded_to": loops.c.newest_ns,
    "priority": priority(verdicts).label("priority"),
    **by_words(verdicts),
}
"""What the table can be sorted by; sentences have no order that means anything, and no cursor holds them."""
OF_RUN = SORTABLE | {"recorded_to": verdicts.c.input_end_ns}
"""The same of a run, which answers the same once newer samples have come."""
OF_LOOPS = ("loop", "unit", "type", "owner", "importance", "recorded_to")
KEPT = ("verdict", "reliability", "likely_cause", "table2_reading", "stiction_probability", "health")
QUICK = (
    {name: SORTABLE[name] for name in OF_LOOPS}
    | {name: newest_rows.c[name] for name in KEPT}
    | {"priority": priority(newest_rows).label("priority"), **by_words(newest_rows)}
)
"""What can be asked of loops and their newest rows alone: two small tables, however many nights there are."""


class HealthRange(NamedTuple):
    """From where on and below where; None: no bound on that side. Both None: those without one."""

    least: float | None
    below: float | None


@dataclass(frozen=True)
class RowFilter:
    """Which rows of the table: all that are given must hold. retired: of loops that are retired, by default not; None:
    of both. recorded_from_ns, recorded_before_ns: by the loop's newest sample. left_out: not of these loops, by id;
    open_order: whether a work order is written that no repair was stated since; tags: of these alone; no_unit: whether
    they name no unit."""

    verdict: tuple[str, ...] | None = None
    reliability: str | None = None
    unit: str | None = None
    type: str | None = None
    owner: str | None = None
    likely_cause: str | None = None
    table2_reading: str | None = None
    min_probability: float | None = None
    audit_id: int | None = None
    search: str | None = None
    retired: bool | None = False
    recorded_from_ns: int | None = None
    recorded_before_ns: int | None = None
    left_out: tuple[int, ...] = ()
    open_order: bool | None = None
    tags: tuple[str, ...] | None = None
    no_unit: bool | None = None
    health: HealthRange | None = None


@dataclass(frozen=True)
class Order:
    """By which name rows are sorted, in which direction; unknown values come last in both."""

    name: str
    descending: bool = False

    @classmethod
    def parsed(cls, sort: str) -> "Order":
        """As it is asked for: a minus before the name turns the order round."""
        return cls(sort.removeprefix("-"), sort.startswith("-"))


@dataclass(frozen=True)
class After:
    """The last row of a page: its sort value and its tag."""

    value: Any
    tag: str


def comparable(sort: str, value: Any) -> bool:
    """Whether the table can be sorted by this name, and a row of it could have this value there."""
    column = SORTABLE.get(sort)
    if column is None or value is None:
        return column is not None
    kind = column.type.python_type
    if isinstance(value, int):
        return kind is float or (kind is int and abs(value) <= _largest(column))
    return isinstance(value, kind)


def _largest(column: ColumnElement[Any]) -> int:
    """The largest number that a column of whole numbers can be compared with on PostgreSQL."""
    return 2**63 - 1 if isinstance(column.type, BigInteger) else 2**31 - 1


def in_order(column: ColumnElement[Any], order: Order) -> tuple[Any, ...]:
    """By value, unknown ones last, then by tag."""
    return (column.desc() if order.descending else column.asc()).nulls_last(), loops.c.tag


def beyond(column: ColumnElement[Any], order: Order, after: After) -> ColumnElement[bool]:
    """Rows after `after` in the order of `table`: by value, unknown ones last, then by tag."""
    if after.value is None:
        return and_(column.is_(None), loops.c.tag > after.tag)
    further = column < after.value if order.descending else column > after.value
    return or_(further, and_(column == after.value, loops.c.tag > after.tag), column.is_(None))


def of_filter(wanted: RowFilter, columns: Mapping[str, Any] = SORTABLE) -> list[ColumnElement[bool]]:
    """The conditions of a filter, by the columns that are asked for."""
    conditions: list[ColumnElement[bool]] = []
    if wanted.retired is not None:
        conditions.append(loops.c.retired if wanted.retired else IN_SERVICE)
    if wanted.verdict is not None:
        conditions.append(columns["verdict"].in_(wanted.verdict))
    for name in ("reliability", "unit", "type", "owner", "table2_reading"):
        value = getattr(wanted, name)
        if value is not None:
            conditions.append(columns[name] == value)
    if wanted.likely_cause is not None:
        conditions.append(of_cause(columns, wanted.likely_cause))
    if wanted.health is not None:
        conditions.append(_of_health(columns["health"], wanted.health))
    if wanted.min_probability is not None:
        conditions.append(columns["stiction_probability"] >= wanted.min_probability)
    return [*conditions, *_by_newest_sample(wanted), *_of_loops(wanted)]


def _of_health(column: ColumnElement[Any], wanted: HealthRange) -> ColumnElement[bool]:
    bounds = _within(column, *wanted)
    return and_(*bounds) if bounds else column.is_(None)


def _of_loops(wanted: RowFilter) -> list[ColumnElement[bool]]:
    conditions: list[ColumnElement[bool]] = []
    if wanted.left_out:
        conditions.append(loops.c.id.not_in(wanted.left_out))
    if wanted.no_unit is not None:
        conditions.append(loops.c.unit.is_(None) if wanted.no_unit else loops.c.unit.is_not(None))
    if wanted.open_order is not None:
        conditions.append(has_open_order() if wanted.open_order else ~has_open_order())
    if wanted.tags is not None:
        conditions.append(loops.c.tag.in_(wanted.tags))
    if wanted.search:
        conditions.append(found_by(wanted.search))
    return conditions


def _by_newest_sample(wanted: RowFilter) -> list[ColumnElement[bool]]:
    """Of a run the newest that it was given, so that it answers the same once newer ones have come."""
    end = loops.c.newest_ns if wanted.audit_id is None else verdicts.c.input_end_ns
    return _within(end, wanted.recorded_from_ns, wanted.recorded_before_ns)


def _within(column: ColumnElement[Any], least: float | None, below: float | None) -> list[ColumnElement[bool]]:
    return [*([] if least is None else [column >= least]), *([] if below is None else [column < below])]
