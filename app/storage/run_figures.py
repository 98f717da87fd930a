"""What a run came to: its verdicts by kind, and how long its loops took."""

from typing import NamedTuple

from sqlalchemy import Connection, func, select

from app.storage.tables import loops, verdicts


class Durations(NamedTuple):
    """How long loops took, s: how many there are, their sum, mean and greatest; None where there are none."""

    loops: int
    total: float | None
    mean: float | None
    longest: float | None


class Slow(NamedTuple):
    tag: str
    elapsed_s: float


def durations(connection: Connection, audit_id: int) -> Durations:
    """Of a run."""
    took = verdicts.c.elapsed_s
    figures = [func.count().label("loops"), func.sum(took).label("total"), func.avg(took).label("mean")]
    query = select(*figures, func.max(took).label("longest")).where(verdicts.c.audit_id == audit_id)
    return Durations._make(connection.execute(query).one())


def slowest(connection: Connection, audit_id: int, limit: int) -> list[Slow]:
    query = select(loops.c.tag, verdicts.c.elapsed_s).join(loops, loops.c.id == verdicts.c.loop_id)
    query = query.where(verdicts.c.audit_id == audit_id).order_by(verdicts.c.elapsed_s.desc()).limit(limit)
    return [Slow._make(row) for row in connection.execute(query)]


def verdict_counts(connection: Connection, audit_id: int) -> dict[str, int]:
    query = select(verdicts.c.verdict, func.count()).where(verdicts.c.audit_id == audit_id).group_by(verdicts.c.verdict)
    return {verdict: count for verdict, count in connection.execute(query)}
