"""What several questions ask alike: the newest verdict of a loop, and which loops come first, by what is missing to
full health times importance."""

from collections.abc import Callable, Mapping
from typing import Any

from sqlalchemy import CTE, ColumnElement, Connection, FromClause, Select, and_, func, or_, select

from app.engine.codes import NO_ANSWER_VERDICTS, UNANSWERED
from app.storage.tables import loops, newest_rows, verdicts

TOO_LITTLE_DATA = "data"
"""What loops that are not auditable are counted and asked for under where no cause is named; it stands in no row."""


def is_newest(said: FromClause) -> ColumnElement[bool]:
    """said: `verdicts`, `newest_rows`, or an alias of them."""
    return and_(said.c.loop_id == loops.c.id, said.c.audit_id == loops.c.newest_audit_id)


NEWEST_VERDICTS = loops.join(verdicts, is_newest(verdicts))
NEWEST_ROWS = loops.join(newest_rows, is_newest(newest_rows))
"""Loops with their newest verdict; without those that have none."""


def unanswered(said: FromClause) -> ColumnElement[bool]:
    """Of loops in which PV does not answer OP, whether that is a verdict or keeps from one."""
    return and_(said.c.likely_cause == UNANSWERED, said.c.verdict.in_(NO_ANSWER_VERDICTS))


def of_cause(columns: Mapping[str, Any], cause: str) -> ColumnElement[bool]:
    named: ColumnElement[bool] = columns["likely_cause"] == cause
    if cause != TOO_LITTLE_DATA:
        return named
    return or_(named, and_(columns["verdict"] == "not_auditable", columns["likely_cause"].is_(None)))


def priority(said: FromClause) -> ColumnElement[Any]:
    """NULL where the health is not known."""
    return loops.c.importance * (100.0 - said.c.health)


def worst_first(said: FromClause) -> tuple[ColumnElement[Any], ...]:
    """The order by `priority`, loops of unknown health last, then by tag."""
    return priority(said).desc().nulls_last(), loops.c.tag


counted = verdicts.alias("counted")  # here, as to list its columns anew takes longer than many a query

Which = Callable[[FromClause, FromClause], tuple[ColumnElement[bool], ...]]
"""Conditions on verdicts (the first) of loops (the second, which has their newest_audit_id)."""


def last_of(each: int, asked: ColumnElement[bool], which: Which) -> tuple[CTE, ColumnElement[bool]]:
    """Id and tag of the loops that are asked for, and on what to join `verdicts` to them so that a loop has its newest
    `each` of those that are meant by `which`.

    To number a loop's verdicts takes all of them, of which there is one a night, for years.
    """
    mine = (counted.c.loop_id == loops.c.id, *which(counted, loops))
    oldest = select(counted.c.audit_id).where(*mine).order_by(counted.c.audit_id.desc()).offset(each - 1).limit(1)
    since = func.coalesce(oldest.correlate(loops).scalar_subquery(), 0).label("since")
    told = select(loops.c.id, loops.c.tag, loops.c.newest_audit_id, since).where(asked)
    # Once a loop: PostgreSQL may look for it anew at each verdict else.
    lasts = told.cte("lasts").prefix_with("MATERIALIZED", dialect="postgresql")
    theirs = (verdicts.c.loop_id == lasts.c.id, verdicts.c.audit_id >= lasts.c.since)
    return lasts, and_(*theirs, *which(verdicts, lasts))


def heads_of_units(connection: Connection, listed: Select[Any], said: FromClause, each: int) -> list[Any]:
    """Of each unit the first `each` of the loops that are `listed`, whose verdicts are `said`: by unit, the worst
    first."""
    place = func.row_number().over(partition_by=loops.c.unit, order_by=worst_first(said)).label("place")
    placed = listed.add_columns(place).subquery()
    shown = [column for column in placed.c if column.name != "place"]
    query = select(*shown).where(placed.c.place <= each).order_by(placed.c.unit, placed.c.place)
    return list(connection.execute(query))


def heads(connection: Connection, listed: Select[Any], said: FromClause, most: int) -> list[Any]:
    """The first `most` of all units."""
    return list(connection.execute(listed.order_by(*worst_first(said)).limit(most)))
