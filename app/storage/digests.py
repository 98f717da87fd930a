"""What a digest tells of one run, whenever it is asked: later runs change nothing of it. Loops that have been retired
since are not told of."""

from collections.abc import Collection, Iterable, Sequence
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, Connection, Select, and_, func, not_, or_, select

from app.storage.loops import IN_SERVICE
from app.storage.newest import unanswered, worst_first
from app.storage.plant import ChangedRow, first_news, told_of_both, unjudged_as_before
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


TEXTS = ("reasons_text", "reasons_text_before", "extra_json", "extra_json_before")

this = verdicts.alias("of_the_run")
before = verdicts.alias("earlier")
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


def changed_of(connection: Connection, audit_id: int) -> list[ChangedRow]:
    """Loops whose verdict in this run is another one than their verdict before, the worst first: what tells which kind
    of change each is. In a night of a new method they are all loops of the plant, and most of a row are its texts."""
    told = [column for column in told_of_both(this, before) if column.key not in TEXTS]
    query = _changed(audit_id, told).order_by(*worst_first(this))
    return [ChangedRow(*row) for row in connection.execute(query)]


def changes_of(connection: Connection, audit_id: int, tags: Collection[str]) -> list[ChangedRow]:
    """Of these of them what `plant.changes` tells."""
    query = _changed(audit_id, told_of_both(this, before)).where(loops.c.tag.in_(tags))
    return [ChangedRow(*row) for row in connection.execute(query)]


def _changed(audit_id: int, told: Iterable[ColumnElement[Any]]) -> Select[Any]:
    earlier = (
        select(func.max(before.c.audit_id))
        .where(before.c.loop_id == this.c.loop_id, before.c.audit_id < audit_id)
        .correlate(this)
        .scalar_subquery()
    )
    joined = _OF_RUN.outerjoin(before, and_(before.c.loop_id == this.c.loop_id, before.c.audit_id == earlier))
    of_loop = (loops.c.tag, loops.c.unit, before.c.verdict.label("verdict_before"), this.c.verdict, this.c.health)
    news = or_(this.c.verdict != before.c.verdict, first_news(before.c.verdict, this.c.verdict))
    same = unjudged_as_before(this.c.verdict, before.c.verdict, this.c.likely_cause, before.c.likely_cause)
    return select(*of_loop, *told).select_from(joined).where(this.c.audit_id == audit_id, news, not_(same))


def counts_of(connection: Connection, audit_id: int) -> list[CountRow]:
    """Loops of the run by verdict, reliability and likely cause."""
    by = (this.c.verdict, this.c.reliability, this.c.likely_cause)
    query = select(*by, func.count().label("loops")).select_from(_OF_RUN).where(this.c.audit_id == audit_id)
    return [CountRow._make(row) for row in connection.execute(query.group_by(*by))]


def retired_since(connection: Connection, audit_id: int) -> int:
    """How many loops with a verdict of the run are not counted, because they have been retired."""
    query = select(func.count()).select_from(loops.join(this, this.c.loop_id == loops.c.id))
    return connection.scalar(query.where(this.c.audit_id == audit_id, loops.c.retired)) or 0
