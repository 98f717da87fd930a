"""The plant as a whole: what its units come to, and whose verdict is another one than in the run before."""

from typing import Any

from sqlalchemy import Connection, and_, func, or_, select

from app.storage.tables import audits, loops, verdicts

newest = verdicts.alias("newest")
before = verdicts.alias("earlier")
_newest_one = and_(newest.c.loop_id == loops.c.id, newest.c.audit_id == loops.c.newest_audit_id)


def counts(connection: Connection) -> list[Any]:
    """Loops, sum of importances and sum of importance x health, by unit, verdict, reliability and likely cause."""
    by = [loops.c.unit, newest.c.verdict, newest.c.reliability, newest.c.likely_cause]
    figures = [
        func.count().label("loops"),
        func.sum(loops.c.importance).label("importance"),
        func.sum(loops.c.importance * newest.c.health).label("weighted_health"),
    ]
    return list(connection.execute(select(*by, *figures).select_from(loops.join(newest, _newest_one)).group_by(*by)))


def tiles(connection: Connection) -> list[Any]:
    """What a treemap shows of each audited loop: tag, unit, importance, verdict, reliability, health."""
    query = select(
        loops.c.tag, loops.c.unit, loops.c.importance, newest.c.verdict, newest.c.reliability, newest.c.health
    )
    return list(connection.execute(query.select_from(loops.join(newest, _newest_one)).order_by(loops.c.tag)))


def last_whole_run(connection: Connection) -> Any:
    """The newest nightly run that has ended; where there is none, the newest ended run of all loops of its day."""
    ended = audits.c.state.in_(("done", "partial"))
    query = select(audits.c.id, audits.c.created_at, audits.c.trigger, audits.c.total).where(ended)
    nightly = connection.execute(
        query.where(audits.c.trigger == "nightly").order_by(audits.c.id.desc()).limit(1)
    ).one_or_none()
    if nightly is not None:
        return nightly
    return connection.execute(query.order_by(audits.c.total.desc(), audits.c.id.desc()).limit(1)).one_or_none()


def any_run_before(connection: Connection, audit_id: int) -> bool:
    return connection.scalar(select(audits.c.id).where(audits.c.id < audit_id, audits.c.total > 0).limit(1)) is not None


def changes(connection: Connection, since_audit: int, limit: int) -> list[Any]:
    """Loops whose newest verdict, of `since_audit` or later, is another one than their verdict before.

    The worst of them first, by importance x health.
    """
    earlier = (
        select(func.max(before.c.audit_id))
        .where(before.c.loop_id == newest.c.loop_id, before.c.audit_id < newest.c.audit_id)
        .correlate(newest)
        .scalar_subquery()
    )
    joined = loops.join(newest, _newest_one).outerjoin(
        before, and_(before.c.loop_id == newest.c.loop_id, before.c.audit_id == earlier)
    )
    query = select(
        loops.c.tag,
        loops.c.unit,
        before.c.verdict.label("verdict_before"),
        newest.c.verdict,
        newest.c.reasons_text,
        newest.c.health,
        (newest.c.engine_version != before.c.engine_version).label("engine_changed"),
        (newest.c.config_fingerprint != before.c.config_fingerprint).label("config_changed"),
        (newest.c.filled_share - before.c.filled_share).label("filled_more"),
        (newest.c.samples * 1.0 / func.nullif(before.c.samples, 0)).label("samples_ratio"),
        (newest.c.sampling_interval_s / func.nullif(before.c.sampling_interval_s, 0.0)).label("interval_ratio"),
    ).select_from(joined)
    # A first verdict is news only where something is wrong.
    news = or_(newest.c.verdict != before.c.verdict, and_(before.c.verdict.is_(None), newest.c.verdict == "stiction"))
    priority = loops.c.importance * (100.0 - newest.c.health)
    query = query.where(newest.c.audit_id >= since_audit, news)
    return list(connection.execute(query.order_by(priority.desc().nulls_last(), loops.c.tag).limit(limit)))


def durations(connection: Connection, audit_id: int) -> Any:
    """How long the loops of a run took, in seconds: count, sum, mean, greatest."""
    took = verdicts.c.elapsed_s
    figures = [func.count().label("loops"), func.sum(took).label("total"), func.avg(took).label("mean")]
    query = select(*figures, func.max(took).label("longest")).where(verdicts.c.audit_id == audit_id)
    return connection.execute(query).one()


def slowest(connection: Connection, audit_id: int, limit: int) -> list[Any]:
    query = select(loops.c.tag, verdicts.c.elapsed_s).join(loops, loops.c.id == verdicts.c.loop_id)
    query = query.where(verdicts.c.audit_id == audit_id).order_by(verdicts.c.elapsed_s.desc()).limit(limit)
    return list(connection.execute(query))


def verdict_counts(connection: Connection, audit_id: int) -> dict[str, int]:
    query = select(verdicts.c.verdict, func.count()).where(verdicts.c.audit_id == audit_id).group_by(verdicts.c.verdict)
    return {verdict: count for verdict, count in connection.execute(query)}


def units(connection: Connection) -> list[str]:
    query = select(loops.c.unit).where(loops.c.unit.is_not(None)).distinct().order_by(loops.c.unit)
    return list(connection.scalars(query))
