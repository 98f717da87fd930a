"""The plant as a whole: what its units come to, and whose verdict is another one than in the run before."""

from collections.abc import Collection, Sequence
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from sqlalchemy import (
    Column,
    ColumnElement,
    Connection,
    FromClause,
    ScalarSelect,
    Select,
    and_,
    case,
    func,
    not_,
    or_,
    select,
)

from app.storage.audits import WITH_RESULTS, of_a_night, of_the_whole_plant
from app.storage.bulk import among_many
from app.storage.continuing import before_first_verdict, counts_in
from app.storage.loops import IN_SERVICE
from app.storage.newest import NEWEST_ROWS, heads, heads_of_units, is_newest, priority, unanswered, worst_first
from app.storage.tables import audits, loops, newest_rows, verdicts

A_DAY = timedelta(days=1)

rows = newest_rows
newest = verdicts.alias("newest")
before = verdicts.alias("earlier")
_NEWEST = loops.join(rows, and_(is_newest(rows), IN_SERVICE))


COMPLAINTS = ("stiction", "inconclusive")
UNJUDGED = ("inconclusive", "not_auditable")


class ChangedRow(NamedTuple):
    """A verdict beside the one before it, whose fields are None where there is none. The texts, which are most of it,
    are those of no verdict where they were not asked for."""

    tag: str
    unit: str | None
    verdict_before: str | None
    verdict: str
    health: float | None
    reliability: str
    reasons: str
    likely_cause: str | None
    probability: float | None
    probability_before: float | None
    reasons_before: str | None
    likely_cause_before: str | None
    engine_changed: bool | None
    config_changed: bool | None
    filled_more: float | None
    samples_ratio: float | None
    interval_ratio: float | None
    reasons_text: str = ""
    reasons_text_before: str | None = None
    extra_json: str = "{}"
    extra_json_before: str | None = None


class SecondNight(NamedTuple):
    """probability_between: that of the first of the two nights."""

    changed: ChangedRow
    probability_between: float | None


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


def changes(connection: Connection, since_audit: int, limit: int, left_out: Sequence[int] = ()) -> list[ChangedRow]:
    """Loops whose newest verdict, of `since_audit` or later, is another one than their last verdict before that run;
    `left_out`: not these loops, by id.

    Those that are said to stick first, then the worst of them, by importance x health.
    """
    listed = _changed(since_audit)
    listed = listed.where(rows.c.loop_id.not_in(left_out)) if left_out else listed
    # Verdicts are looked up for those that are listed: in a night of a new method every loop may be news.
    sticks_first = case((rows.c.verdict == "stiction", 0), else_=1)
    found = listed.order_by(sticks_first, *worst_first(rows)).limit(limit).subquery()
    joined = found.join(newest, and_(newest.c.loop_id == found.c.loop_id, newest.c.audit_id == found.c.audit_id))
    query = select(
        *(found.c.tag, found.c.unit, found.c.verdict_before, found.c.verdict, found.c.health),
        *told_of_both(newest, before),
    ).select_from(
        joined.outerjoin(
            before, and_(before.c.loop_id == found.c.loop_id, before.c.audit_id == found.c.before_audit_id)
        )
    )
    sticks_first = case((found.c.verdict == "stiction", 0), else_=1)
    ordered = query.order_by(sticks_first, found.c.priority.desc().nulls_last(), found.c.tag)
    return [ChangedRow(*row) for row in connection.execute(ordered)]


def changed_of(connection: Connection, since_audit: int, loop_ids: Collection[int]) -> frozenset[str]:
    """Which of these loops `changes` would list, by tag, however many there are."""
    if not loop_ids:
        return frozenset()
    listed = _changed(since_audit).where(among_many(connection, rows.c.loop_id, loop_ids)).subquery()
    return frozenset(connection.scalars(select(listed.c.tag)))


def _changed(since_audit: int) -> Select[Any]:
    # A row knows the verdict before it; where a loop was audited again since the run, that may be the run's own.
    again = rows.c.audit_id > since_audit
    verdict_before = case((again, _last_before(since_audit, verdicts.c.verdict)), else_=rows.c.verdict_before)
    audit_before = case((again, _last_before(since_audit, verdicts.c.audit_id)), else_=rows.c.before_audit_id)
    news = or_(rows.c.verdict != verdict_before, first_news(verdict_before, rows.c.verdict))
    listed = select(
        *(loops.c.tag, loops.c.unit, priority(rows).label("priority"), rows.c.loop_id, rows.c.audit_id),
        *(audit_before.label("before_audit_id"), verdict_before.label("verdict_before")),
        *(rows.c.verdict, rows.c.health),
    ).select_from(NEWEST_ROWS)
    # Asked of the loop itself, SQLite would begin with the loops and look up the wide row of each.
    in_service = rows.c.loop_id.not_in(select(loops.c.id).where(loops.c.retired))
    because = _last_before(since_audit, verdicts.c.likely_cause)
    same = unjudged_as_before(rows.c.verdict, verdict_before, rows.c.likely_cause, because)
    return listed.where(rows.c.audit_id >= since_audit, news, in_service, not_(same))


def first_news(verdict_before: Any, verdict: ColumnElement[Any]) -> ColumnElement[bool]:
    """Of a loop's first verdict: it is news only where something is wrong that was not said under the tag before."""
    earlier, its, tags = loops.alias("under_the_tag_before"), newest_rows.alias("its_newest"), before_first_verdict()
    known = select(its.c.loop_id).join(earlier, earlier.c.id == its.c.loop_id)
    known = known.join(tags, tags.c.earlier == earlier.c.tag)
    known = known.where(tags.c.tag == loops.c.tag, its.c.verdict == "stiction").correlate(loops)
    return and_(verdict_before.is_(None), verdict == "stiction", ~known.exists())


def unjudged_as_before(
    verdict: ColumnElement[Any], verdict_before: Any, because: ColumnElement[Any], because_before: Any
) -> ColumnElement[bool]:
    """Whether a loop that could not be judged before is not judged now for the same reason: a dead transmitter is no
    news the second night, whichever of the two verdicts it gets."""
    judged_neither = (verdict.in_(UNJUDGED), func.coalesce(verdict_before, "").in_(UNJUDGED))
    return and_(*judged_neither, func.coalesce(because, "") == func.coalesce(because_before, "-"))


def second_nights(connection: Connection, audit_id: int, limit: int) -> list[SecondNight]:
    """Loops that a run and the one before said to stick, both not to be relied on, after they were said to do
    otherwise: as `changes`, against the verdict before both."""
    between, third = verdicts.alias("between"), verdicts.alias("third")
    sticks = (newest.c.verdict == "stiction", newest.c.reliability == "not_reliable")
    first = and_(between.c.loop_id == newest.c.loop_id, between.c.audit_id == _before(newest))
    so = (between.c.verdict == "stiction", between.c.reliability == "not_reliable")
    ground = and_(third.c.loop_id == newest.c.loop_id, third.c.audit_id == _before(between))
    joined = loops.join(newest, newest.c.loop_id == loops.c.id).join(between, first).join(third, ground)
    told = (loops.c.tag, loops.c.unit, third.c.verdict.label("verdict_before"), newest.c.verdict, newest.c.health)
    query = select(*told, *told_of_both(newest, third), between.c.stiction_probability.label("probability_between"))
    query = query.select_from(joined).where(newest.c.audit_id == audit_id, *sticks, *so, third.c.verdict != "stiction")
    found = heads(connection, query.where(IN_SERVICE), newest, limit)
    return [SecondNight(ChangedRow(*row[:-1]), row[-1]) for row in found]


def _before(row: Any) -> ScalarSelect[Any]:
    """The run of the loop's verdict before this one: of the same samples, one is no other night's."""
    mine = verdicts.alias()
    earlier = (mine.c.loop_id == row.c.loop_id, mine.c.audit_id < row.c.audit_id)
    other = mine.c.input_end_ns.is_distinct_from(row.c.input_end_ns)
    # The last one ends the search: the greatest of all would have a year of nights looked at.
    query = select(mine.c.audit_id).where(*earlier, other).order_by(mine.c.audit_id.desc()).limit(1)
    return query.correlate(row).scalar_subquery()


def _last_before(audit_id: int, column: Column[Any]) -> ScalarSelect[Any]:
    """This column of the loop's last verdict before a run."""
    mine = (verdicts.c.loop_id == rows.c.loop_id, verdicts.c.audit_id < audit_id)
    query = select(column).where(*mine).order_by(verdicts.c.audit_id.desc()).limit(1)
    return query.correlate(rows).scalar_subquery()


def told_of_both(now: FromClause, earlier: FromClause) -> tuple[ColumnElement[Any], ...]:
    """What tells why the verdict `now` is another one than the `earlier` one: the fields of `ChangedRow` behind those
    of the loop."""
    return (
        now.c.reliability,
        now.c.reasons,
        now.c.likely_cause,
        now.c.stiction_probability.label("probability"),
        earlier.c.stiction_probability.label("probability_before"),
        earlier.c.reasons.label("reasons_before"),
        earlier.c.likely_cause.label("likely_cause_before"),
        (now.c.engine_version != earlier.c.engine_version).label("engine_changed"),
        (now.c.config_fingerprint != earlier.c.config_fingerprint).label("config_changed"),
        (now.c.filled_share - earlier.c.filled_share).label("filled_more"),
        (now.c.samples * 1.0 / func.nullif(earlier.c.samples, 0)).label("samples_ratio"),
        (now.c.sampling_interval_s / func.nullif(earlier.c.sampling_interval_s, 0.0)).label("interval_ratio"),
        now.c.reasons_text,
        earlier.c.reasons_text.label("reasons_text_before"),
        now.c.extra_json,
        earlier.c.extra_json.label("extra_json_before"),
    )


def units(connection: Connection) -> list[str]:
    query = select(loops.c.unit).where(loops.c.unit.is_not(None), IN_SERVICE).distinct().order_by(loops.c.unit)
    return list(connection.scalars(query))
