"""How far records reach: of the plant as it is now, or of what one run was given."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, Connection, FromClause, Select, Subquery, and_, case, func, or_, select

from app.nanoseconds import EVER_NS
from app.storage.audits import WITH_RESULTS
from app.storage.bulk import among
from app.storage.loops import IN_SERVICE
from app.storage.tables import audits, in_words, loops, series, uploads, verdicts

earlier_verdict, given_then = verdicts.alias("earlier"), verdicts.alias("given_then")
FIRST_FEW = 100
"""Loops of a run that are asked by themselves whether they were given anything new."""


class EndRow(NamedTuple):
    """A loop and the time of its newest sample."""

    id: int
    tag: str
    end_ns: int


def newest(connection: Connection, since_ns: int, until_ns: int, audit_id: int | None = None) -> int | None:
    """Time of the newest sample of all loops, of those between the two, both included; None where there is none.

    audit_id: of what this run was given; None: of all that is stored.
    """
    ends = _ends(audit_id)
    return connection.scalar(select(func.max(ends.c.end_ns)).where(ends.c.end_ns.between(since_ns, until_ns)))


def ending(
    connection: Connection, since_ns: int, before_ns: int, limit: int, audit_id: int | None = None
) -> tuple[int, list[tuple[str, int]]]:
    """How many loops have their newest sample from `since_ns` on and before `before_ns`, and tag and time of the
    weightiest of them."""
    ends = _ends(audit_id)
    such = and_(ends.c.end_ns >= since_ns, ends.c.end_ns < before_ns)
    count = connection.scalar(select(func.count()).select_from(ends).where(such)) or 0
    if not count:
        return 0, []
    query = select(ends.c.tag, ends.c.end_ns).where(such).order_by(ends.c.importance.desc(), ends.c.tag).limit(limit)
    return count, [(tag, end_ns) for tag, end_ns in connection.execute(query)]


def middle(connection: Connection, since_ns: int, until_ns: int, audit_id: int | None = None) -> int | None:
    """How far at least half of the records reach, of those that end between the two; None where there is none."""
    ends = _ends(audit_id)
    told = ends.c.end_ns.between(since_ns, until_ns)
    count = connection.scalar(select(func.count()).select_from(ends).where(told)) or 0
    query = select(ends.c.end_ns).where(told).order_by(ends.c.end_ns.desc())
    return connection.scalar(query.offset((count - 1) // 2).limit(1)) if count else None


def those_ending(
    connection: Connection, since_ns: int, before_ns: int, limit: int, audit_id: int | None = None
) -> list[EndRow]:
    """The loops whose newest sample is between the two, as in `ending`."""
    ends = _ends(audit_id)
    such = and_(ends.c.end_ns >= since_ns, ends.c.end_ns < before_ns)
    query = select(ends.c.id, ends.c.tag, ends.c.end_ns).where(such)
    found = connection.execute(query.order_by(ends.c.importance.desc(), ends.c.tag).limit(limit))
    return [EndRow._make(row) for row in found]


def earlier(
    connection: Connection, loop_ids: Sequence[int], before: int | None, runs: int
) -> dict[int, dict[int, int]]:
    """The newest sample that each of these loops was given in each of the last `runs` runs before one (None: in the
    last ones), by run and loop."""
    last = select(audits.c.id).order_by(audits.c.id.desc()).limit(runs)
    numbers = list(connection.scalars(last if before is None else last.where(audits.c.id < before)))
    given = (verdicts.c.audit_id.in_(numbers), among(connection, verdicts.c.loop_id, loop_ids))
    query = select(verdicts.c.audit_id, verdicts.c.loop_id, verdicts.c.input_end_ns)
    found: dict[int, dict[int, int]] = {}
    for run, loop, end_ns in connection.execute(query.where(*given, verdicts.c.input_end_ns.is_not(None))):
        found.setdefault(run, {})[loop] = end_ns
    return found


def anything_new(connection: Connection, audit_id: int) -> bool:
    """Whether a loop of this run was given samples that none of its verdicts before was, or has none before."""
    of_run = select(verdicts.c.loop_id, verdicts.c.input_end_ns).where(verdicts.c.audit_id == audit_id)
    # The first few tell after any export; of a night without one all loops are to be asked.
    return _any_newer(connection, audit_id, of_run.limit(FIRST_FEW)) or _any_newer(
        connection, audit_id, _newer_than_in_a_run_before(of_run, audit_id)
    )


def _newer_than_in_a_run_before(of_run: Select[Any], audit_id: int) -> Select[Any]:
    """Of these verdicts those that may be new: not the loops whose verdict in an earlier run ends as late. That is the
    last run of half as many loops or more, because two runs are compared in one pass, where each loop's verdicts before
    are a search of their own."""
    this, run_before = audits.alias("this"), audits.alias("run_before")
    as_large = (run_before.c.id < audit_id, 2 * run_before.c.total >= this.c.total)
    both = run_before.join(this, this.c.id == audit_id)
    with_results = in_words(run_before.c.state, *WITH_RESULTS)
    run = select(func.max(run_before.c.id)).select_from(both).where(*as_large, with_results)
    mine = and_(given_then.c.loop_id == verdicts.c.loop_id, given_then.c.audit_id == run.scalar_subquery())
    newer = given_then.c.input_end_ns < func.coalesce(verdicts.c.input_end_ns, -EVER_NS)
    joined = verdicts.outerjoin(given_then, mine)
    return of_run.select_from(joined).where(or_(given_then.c.input_end_ns.is_(None), newer))


def _any_newer(connection: Connection, audit_id: int, of_run: Select[Any]) -> bool:
    """Whether one of these verdicts of the run was given more than all before it."""
    # Apart from what is asked of each: PostgreSQL would ask it of all that are left out as well.
    these = of_run.cte("these").prefix_with("MATERIALIZED", dialect="postgresql")
    given = (
        earlier_verdict.c.loop_id == these.c.loop_id,
        earlier_verdict.c.audit_id < audit_id,
        earlier_verdict.c.input_end_ns.is_not(None),
    )
    last = select(earlier_verdict.c.input_end_ns).where(*given).order_by(earlier_verdict.c.audit_id.desc()).limit(1)
    ever = select(func.max(earlier_verdict.c.input_end_ns)).where(*given)
    # The last one leaves few to ask for all before, which is a row a night.
    newer = and_(_beyond(these, last), _beyond(these, ever))
    return connection.scalar(select(these.c.loop_id).where(newer).limit(1)) is not None


def anything_given(connection: Connection, audit_id: int) -> bool:
    """Whether a loop of this run that is in service was given samples."""
    return connection.scalar(select(_ends(audit_id).c.id).limit(1)) is not None


def _beyond(said: FromClause, before: Select[tuple[int | None]]) -> ColumnElement[bool]:
    """Whether a verdict was given samples after that time of its loop, or there is no such time, which goes before a
    verdict that was given none."""
    known = func.coalesce(before.correlate(said).scalar_subquery(), -EVER_NS - 1)
    return known < func.coalesce(said.c.input_end_ns, -EVER_NS)


def _ends(audit_id: int | None) -> Subquery:
    """Id, tag, importance and newest sample of each loop that is in service: nothing more is to come of the others."""
    shown: tuple[Any, ...] = (loops.c.id, loops.c.tag, loops.c.importance)
    if audit_id is None:
        query = select(*shown, loops.c.newest_ns.label("end_ns"))
        return query.where(loops.c.newest_ns.is_not(None), IN_SERVICE).subquery()
    query = select(*shown, _end_then(audit_id).label("end_ns")).join(verdicts, verdicts.c.loop_id == loops.c.id)
    given = (verdicts.c.audit_id == audit_id, verdicts.c.input_end_ns.is_not(None))
    return query.where(*given, IN_SERVICE).subquery()


def _end_then(audit_id: int) -> ColumnElement[int]:
    """The newest sample that the loop of a verdict had when the run began: what it was given, unless more was read
    before, which then was ahead of the clock. A loop whose clock is wrong is so in its run as it is on the day itself.
    """
    began = select(audits.c.created_at).where(audits.c.id == audit_id).scalar_subquery()
    not_given = (series.c.loop_id == loops.c.id, series.c.end_ns > verdicts.c.input_end_ns)
    reading = select(func.max(series.c.end_ns)).join(uploads, uploads.c.id == series.c.upload_id)
    ahead = reading.where(*not_given, uploads.c.ended_at <= began).correlate(loops, verdicts).scalar_subquery()
    more = case((loops.c.newest_ns > verdicts.c.input_end_ns, ahead))
    return func.coalesce(more, verdicts.c.input_end_ns)
