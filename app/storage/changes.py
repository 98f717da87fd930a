"""Whose verdict is another one than before. `since_run` compares the newest verdicts with those before a run, as pages
tell it; `of_run` compares a run's own verdicts with those before it, as a digest does, whatever came later."""

from collections.abc import Collection, Iterable, Sequence
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

from app.storage.bulk import among_many
from app.storage.continuing import before_first_verdict
from app.storage.loops import IN_SERVICE
from app.storage.newest import NEWEST_ROWS, heads, priority, worst_first
from app.storage.tables import loops, newest_rows, verdicts

UNJUDGED = ("inconclusive", "not_auditable")
TEXTS = ("reasons_text", "reasons_text_before", "extra_json", "extra_json_before")
LOOKED_BACK, FURTHER_BACK = 28, 400
"""Verdicts of a loop among which that of a night before is looked for: four weeks of nights, and a year of them for the
night before that one, because a stop of the plant may lie between the two."""

rows = newest_rows
newest = verdicts.alias("newest")
this = verdicts.alias("of_the_run")
before = verdicts.alias("earlier")
between, third = verdicts.alias("between"), verdicts.alias("third")
before_newest, before_between = verdicts.alias(), verdicts.alias()
under_the_tag, its_newest = loops.alias("under_the_tag_before"), newest_rows.alias("its_newest")
_OF_RUN = loops.join(this, and_(this.c.loop_id == loops.c.id, IN_SERVICE))


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


def since_run(connection: Connection, since_audit: int, limit: int, left_out: Sequence[int] = ()) -> list[ChangedRow]:
    """Loops whose newest verdict, of `since_audit` or later, is another one than their last verdict before that run;
    `left_out`: not these loops, by id.

    Those that are said to stick first, then the worst of them, by importance x health.
    """
    listed = _changed_since(since_audit)
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


def tags_since_run(connection: Connection, since_audit: int, loop_ids: Collection[int]) -> frozenset[str]:
    """Which of these loops `since_run` would list, by tag, however many there are."""
    if not loop_ids:
        return frozenset()
    listed = _changed_since(since_audit).where(among_many(connection, rows.c.loop_id, loop_ids)).subquery()
    return frozenset(connection.scalars(select(listed.c.tag)))


def _changed_since(since_audit: int) -> Select[Any]:
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


def _last_before(audit_id: int, column: Column[Any]) -> ScalarSelect[Any]:
    """This column of the loop's last verdict before a run."""
    mine = (verdicts.c.loop_id == rows.c.loop_id, verdicts.c.audit_id < audit_id)
    query = select(column).where(*mine).order_by(verdicts.c.audit_id.desc()).limit(1)
    return query.correlate(rows).scalar_subquery()


def of_run(connection: Connection, audit_id: int) -> list[ChangedRow]:
    """Loops whose verdict in this run is another one than their verdict before, the worst first: what tells which kind
    of change each is. In a night of a new method they are all loops of the plant, and most of a row are its texts."""
    told = [column for column in told_of_both(this, before) if column.key not in TEXTS]
    query = _changed_in(audit_id, told).order_by(*worst_first(this))
    return [ChangedRow(*row) for row in connection.execute(query)]


def of_run_in_full(connection: Connection, audit_id: int, tags: Collection[str]) -> list[ChangedRow]:
    """Of these of them all that `since_run` tells, texts too."""
    query = _changed_in(audit_id, told_of_both(this, before)).where(loops.c.tag.in_(tags))
    return [ChangedRow(*row) for row in connection.execute(query)]


def _changed_in(audit_id: int, told: Iterable[ColumnElement[Any]]) -> Select[Any]:
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


def second_nights(connection: Connection, audit_id: int, limit: int) -> list[SecondNight]:
    """Loops that a run and the one before said to stick, both not to be relied on, after they were said to do
    otherwise: as `since_run`, against the verdict before both."""
    sticks = (newest.c.verdict == "stiction", newest.c.reliability == "not_reliable")
    night_before = _before(newest, before_newest, LOOKED_BACK)
    first = and_(between.c.loop_id == newest.c.loop_id, between.c.audit_id == night_before)
    so = (between.c.verdict == "stiction", between.c.reliability == "not_reliable")
    before_both = _before(between, before_between, FURTHER_BACK)
    ground = and_(third.c.loop_id == newest.c.loop_id, third.c.audit_id == before_both)
    joined = loops.join(newest, newest.c.loop_id == loops.c.id).join(between, first).join(third, ground)
    told = (loops.c.tag, loops.c.unit, third.c.verdict.label("verdict_before"), newest.c.verdict, newest.c.health)
    query = select(*told, *told_of_both(newest, third), between.c.stiction_probability.label("probability_between"))
    query = query.select_from(joined).where(newest.c.audit_id == audit_id, *sticks, *so, third.c.verdict != "stiction")
    found = heads(connection, query.where(IN_SERVICE), newest, limit)
    return [SecondNight(ChangedRow(*row[:-1]), row[-1]) for row in found]


def _before(row: Any, mine: FromClause, looked_back: int) -> ScalarSelect[Any]:
    """The run of the loop's verdict before this one, of the last `looked_back`: of the same samples, one is no other
    night's. mine: an alias of `verdicts` of its own."""
    earlier = (mine.c.loop_id == row.c.loop_id, mine.c.audit_id < row.c.audit_id)
    # Of loops that get no samples any more, all are of the same ones: there may be years of them.
    query = select(mine.c.audit_id, mine.c.input_end_ns).where(*earlier).order_by(mine.c.audit_id.desc())
    last = query.limit(looked_back).correlate(row).subquery()
    other = select(last.c.audit_id).where(last.c.input_end_ns.is_distinct_from(row.c.input_end_ns)).correlate(row)
    return other.order_by(last.c.audit_id.desc()).limit(1).scalar_subquery()


def first_news(verdict_before: Any, verdict: ColumnElement[Any]) -> ColumnElement[bool]:
    """Of a loop's first verdict: it is news only where something is wrong that was not said under the tag before."""
    tags = before_first_verdict()
    known = select(its_newest.c.loop_id).join(under_the_tag, under_the_tag.c.id == its_newest.c.loop_id)
    known = known.join(tags, tags.c.earlier == under_the_tag.c.tag)
    known = known.where(tags.c.tag == loops.c.tag, its_newest.c.verdict == "stiction").correlate(loops)
    return and_(verdict_before.is_(None), verdict == "stiction", ~known.exists())


def unjudged_as_before(
    verdict: ColumnElement[Any], verdict_before: Any, because: ColumnElement[Any], because_before: Any
) -> ColumnElement[bool]:
    """Whether a loop that could not be judged before is not judged now for the same reason: a dead transmitter is no
    news the second night, whichever of the two verdicts it gets."""
    judged_neither = (verdict.in_(UNJUDGED), func.coalesce(verdict_before, "").in_(UNJUDGED))
    return and_(*judged_neither, func.coalesce(because, "") == func.coalesce(because_before, "-"))


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
