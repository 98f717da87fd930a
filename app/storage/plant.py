"""The plant as a whole: what its units come to, its worst loops, and which runs were of all of it."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, Connection, FromClause, Select, and_, case, func, or_, select

from app.storage.audits import WITH_RESULTS, of_a_night, of_the_whole_plant
from app.storage.continuing import counts_in
from app.storage.loops import IN_SERVICE
from app.storage.newest import heads, heads_of_units, is_newest, unanswered
from app.storage.tables import audits, loops, newest_rows, verdicts

A_DAY = timedelta(days=1)

rows = newest_rows
_NEWEST = loops.join(rows, and_(is_newest(rows), IN_SERVICE))

COMPLAINTS = ("stiction", "inconclusive")


class UnitCount(NamedTuple):
    """How many loops of a unit have one kind of verdict. importance: their sum; weight: that of those with a health;
    weighted_health: the sum of importance x health, None where none has one."""

    unit: str | None
    verdict: str
    reliability: str
    likely_cause: str | None
    loops: int
    importance: float
    weight: float
    weighted_health: float | None


class TileRow(NamedTuple):
    """A loop as the map of the plant has it."""

    tag: str
    unit: str | None
    importance: float
    verdict: str
    health: float | None


class HealthCount(NamedTuple):
    """How many loops of a unit have a health of one class, from the worst, 0, on, and their mean; the last class has
    those without one."""

    unit: str | None
    place: int
    loops: int
    health: float | None


class RunOfNight(NamedTuple):
    """nightly_for: the date whose night the run is, which may begin after midnight; None: no night's."""

    id: int
    created_at: datetime
    ended_at: datetime
    nightly_for: str | None


class WholeRun(NamedTuple):
    """A run of the plant that has ended."""

    id: int
    created_at: datetime
    trigger: str
    total: int


def complains(said: FromClause) -> ColumnElement[bool]:
    """Of loops that stick or may, or in which PV does not answer OP, whether that is a verdict or keeps from one."""
    return or_(said.c.verdict.in_(COMPLAINTS), unanswered(said))


def counts(connection: Connection) -> list[UnitCount]:
    """By unit, verdict, reliability and likely cause."""
    return [UnitCount._make(row) for row in connection.execute(_counted(rows).select_from(_NEWEST))]


def counts_of_run(connection: Connection, audit_id: int) -> list[UnitCount]:
    """The same of what one run said of the loops that are in service, by the tags that these had then, and of the units
    that they have now."""
    of_run = loops.join(verdicts, and_(verdicts.c.loop_id == loops.c.id, counts_in(audit_id)))
    query = _counted(verdicts).select_from(of_run).where(verdicts.c.audit_id == audit_id)
    return [UnitCount._make(row) for row in connection.execute(query)]


def _counted(said: FromClause) -> Select[Any]:
    by = [loops.c.unit, said.c.verdict, said.c.reliability, said.c.likely_cause]
    figures = [
        func.count().label("loops"),
        func.sum(loops.c.importance).label("importance"),
        func.sum(case((said.c.health.is_not(None), loops.c.importance), else_=0.0)).label("weight"),
        func.sum(loops.c.importance * said.c.health).label("weighted_health"),
    ]
    return select(*by, *figures).group_by(*by)


def healths(connection: Connection, limits: Sequence[float]) -> list[HealthCount]:
    """Of each unit, by class; a class reaches up to its limit, and the next one begins there."""
    below = [(rows.c.health < limit, place) for place, limit in enumerate(limits)]
    place = case((rows.c.health.is_(None), len(limits) + 1), *below, else_=len(limits)).label("place")
    query = select(loops.c.unit, place, func.count(), func.avg(rows.c.health)).select_from(_NEWEST)
    return [HealthCount._make(row) for row in connection.execute(query.group_by(loops.c.unit, place))]


def whole_runs(connection: Connection, most: int) -> list[RunOfNight]:
    """The newest ended runs of the whole plant, the newest first."""
    ended = audits.c.state.in_(WITH_RESULTS)
    told = (audits.c[name] for name in RunOfNight._fields)
    query = select(*told).where(ended, of_the_whole_plant(), audits.c.total > 0)
    return [RunOfNight._make(row) for row in connection.execute(query.order_by(audits.c.id.desc()).limit(most))]


def worst_of_units(
    connection: Connection,
    each: int,
    *,
    complaints: bool = False,
    since_ns: int | None = None,
    left_out: Sequence[int] = (),
    audit_id: int | None = None,
) -> list[TileRow]:
    """Of each unit the loops at the head of its list by what is missing to full health x importance. `complaints`: only
    those that `complains` tells of; since_ns: only those with a sample as new as that; `left_out`: not these loops, by
    id; audit_id: by what that run said, and was given (None: by the newest verdicts and samples)."""
    said = _Said.of(audit_id)
    tiles = said.tiles.where(complains(said.rows)) if complaints else said.tiles
    tiles = tiles if since_ns is None else tiles.where(said.newest_ns >= since_ns)
    tiles = tiles.where(loops.c.id.not_in(left_out)) if left_out else tiles
    return [TileRow._make(row) for row in heads_of_units(connection, tiles, said.rows, each)]


def worst_of_old(
    connection: Connection, most: int, before_ns: int, left_out: Sequence[int] = (), audit_id: int | None = None
) -> list[TileRow]:
    """The same of the loops of all units that `complains` tells of and whose newest sample is older than that."""
    said = _Said.of(audit_id)
    old = said.tiles.where(complains(said.rows), said.newest_ns < before_ns, loops.c.id.not_in(left_out))
    return [TileRow._make(row) for row in heads(connection, old, said.rows, most)]


def worst_of_unit(connection: Connection, unit: str | None, limit: int) -> list[TileRow]:
    """The same of one unit (None: of the loops that name none)."""
    mine = loops.c.unit.is_(None) if unit is None else loops.c.unit == unit
    return [TileRow._make(row) for row in heads(connection, _Said.of(None).tiles.where(mine), rows, limit)]


class _Said(NamedTuple):
    """What is said of the loops in service, and up to which sample. joined: with the loops."""

    rows: FromClause
    joined: FromClause
    newest_ns: ColumnElement[Any]

    @classmethod
    def of(cls, audit_id: int | None) -> "_Said":
        """What a run said (None: the newest)."""
        if audit_id is None:
            return cls(rows, _NEWEST, loops.c.newest_ns)
        of_run = and_(verdicts.c.loop_id == loops.c.id, verdicts.c.audit_id == audit_id, IN_SERVICE)
        return cls(verdicts, loops.join(verdicts, of_run), verdicts.c.input_end_ns)

    @property
    def tiles(self) -> Select[Any]:
        shown = (loops.c.tag, loops.c.unit, loops.c.importance, self.rows.c.verdict, self.rows.c.health)
        return select(*shown).select_from(self.joined)


def last_whole_run(connection: Connection) -> WholeRun | None:
    """The newest ended run of the plant: a nightly one, or one of half as many loops as the largest has, or more; as
    the plant has, where it was larger once.

    What somebody starts within a day after a night does not take the night's place: what changed in it is still news.
    """
    ended = audits.c.state.in_(WITH_RESULTS)
    query = select(audits.c.id, audits.c.created_at, audits.c.trigger, audits.c.total).where(ended)
    query = query.order_by(audits.c.id.desc()).limit(1)
    nightly = of_a_night(the_first=True)
    night = connection.execute(query.where(nightly)).one_or_none()
    largest = connection.scalar(select(func.max(audits.c.total)).where(ended)) or 0
    today = connection.scalar(select(func.count()).where(IN_SERVICE, loops.c.newest_ns.is_not(None))) or 0
    asked_for = connection.execute(query.where(~nightly, 2 * audits.c.total >= min(largest, today))).one_or_none()
    found = night
    if night is None or (
        asked_for is not None and asked_for.id > night.id and asked_for.created_at - night.created_at > A_DAY
    ):
        found = asked_for
    return None if found is None else WholeRun._make(found)


def any_run_since(connection: Connection, audit_id: int) -> bool:
    ended = audits.c.state.in_(WITH_RESULTS)
    return connection.scalar(select(audits.c.id).where(audits.c.id > audit_id, ended).limit(1)) is not None


def any_run_before(connection: Connection, audit_id: int) -> bool:
    return connection.scalar(select(audits.c.id).where(audits.c.id < audit_id, audits.c.total > 0).limit(1)) is not None


def units(connection: Connection) -> list[str]:
    query = select(loops.c.unit).where(loops.c.unit.is_not(None), IN_SERVICE).distinct().order_by(loops.c.unit)
    return list(connection.scalars(query))
