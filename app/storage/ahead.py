"""Samples ahead of the clock: kept, and told, but not taken for the newest ones."""

from collections.abc import Collection

from sqlalchemy import ColumnElement, Connection, case, func, select

from app.storage.bulk import among_many
from app.storage.tables import loops, series


def newest_until(connection: Connection, until_ns: int, loop_ids: Collection[int]) -> ColumnElement[int]:
    """The time back from which the record of a loop, one of these, is looked at: of its newest sample, or, where that
    is after `until_ns`, one that is not after the newest sample before it. Of one that has none before it, its newest
    all the same."""
    ahead = select(loops.c.id, _looked_at(until_ns)).where(
        among_many(connection, loops.c.id, loop_ids), _ahead(until_ns)
    )
    # Told as numbers: taken for one query with what asks for them, PostgreSQL would walk all stretches there are.
    known = {loop_id: at_ns for loop_id, at_ns in connection.execute(ahead)}
    return case(known, value=loops.c.id, else_=loops.c.newest_ns) if known else loops.c.newest_ns


def newest_of_all_until(connection: Connection, until_ns: int) -> ColumnElement[int]:
    """The same of any loop."""
    if connection.scalar(select(loops.c.id).where(_ahead(until_ns)).limit(1)) is None:
        return loops.c.newest_ns
    return case((_ahead(until_ns), _looked_at(until_ns)), else_=loops.c.newest_ns)


def _ahead(until_ns: int) -> ColumnElement[bool]:
    return loops.c.newest_ns > until_ns


def _looked_at(until_ns: int) -> ColumnElement[int]:
    seen = case((series.c.end_ns <= until_ns, series.c.end_ns), else_=series.c.start_ns)
    before = select(func.max(seen)).where(series.c.loop_id == loops.c.id, series.c.start_ns <= until_ns)
    return func.coalesce(before.correlate(loops).scalar_subquery(), loops.c.newest_ns)
