"""What a digest tells of one run, whenever it is asked: later runs change nothing of it. Loops that have been retired
since are not told of."""

from collections.abc import Sequence
from typing import NamedTuple

from sqlalchemy import Connection, and_, func, or_, select

from app.storage.loops import IN_SERVICE
from app.storage.newest import unanswered
from app.storage.tables import loops, verdicts


class ToBeDone(NamedTuple):
    verdict: str
    reliability: str
    loops: int


class RefusedRow(NamedTuple):
    """place: among those of the same likely cause, from 1."""

    tag: str
    likely_cause: str | None
    place: int


class CountRow(NamedTuple):
    verdict: str
    reliability: str
    likely_cause: str | None
    loops: int


this = verdicts.alias("of_the_run")
_OF_RUN = loops.join(this, and_(this.c.loop_id == loops.c.id, IN_SERVICE))


def to_be_done(connection: Connection, audit_id: int, since_ns: int | None, left_out: Sequence[int]) -> list[ToBeDone]:
    """By verdict and reliability the loops that stick, or in which PV does not answer OP; without those `left_out`, by
    id. since_ns: only those that were given a sample as new as that."""
    wanted = (this.c.audit_id == audit_id, or_(this.c.verdict == "stiction", unanswered(this)))
    query = select(this.c.verdict, this.c.reliability, func.count().label("loops")).select_from(_OF_RUN).where(*wanted)
    query = query.where(loops.c.id.not_in(left_out))
    query = query if since_ns is None else query.where(this.c.input_end_ns >= since_ns)
    counted = query.group_by(this.c.verdict, this.c.reliability)
    return [ToBeDone._make(row) for row in connection.execute(counted)]


def refused_of(connection: Connection, audit_id: int, each: int, left_out: Sequence[int] = ()) -> list[RefusedRow]:
    """Of each likely cause the first loops that were not auditable, the most important first; without those
    `left_out`, by id."""
    place = func.row_number().over(partition_by=this.c.likely_cause, order_by=(loops.c.importance.desc(), loops.c.tag))
    placed = select(loops.c.tag, this.c.likely_cause, place.label("place")).select_from(_OF_RUN)
    listed = placed.where(this.c.audit_id == audit_id, this.c.verdict == "not_auditable")
    found = listed.where(loops.c.id.not_in(left_out)).subquery()
    listed = select(found).where(found.c.place <= each).order_by(found.c.place)
    return [RefusedRow._make(row) for row in connection.execute(listed)]


def counts_of(connection: Connection, audit_id: int) -> list[CountRow]:
    """Loops of the run by verdict, reliability and likely cause."""
    by = (this.c.verdict, this.c.reliability, this.c.likely_cause)
    query = select(*by, func.count().label("loops")).select_from(_OF_RUN).where(this.c.audit_id == audit_id)
    return [CountRow._make(row) for row in connection.execute(query.group_by(*by))]


def retired_since(connection: Connection, audit_id: int) -> int:
    """How many loops with a verdict of the run are not counted, because they have been retired."""
    query = select(func.count()).select_from(loops.join(this, this.c.loop_id == loops.c.id))
    return connection.scalar(query.where(this.c.audit_id == audit_id, loops.c.retired)) or 0
