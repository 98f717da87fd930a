"""Numbers for monitoring, from SQL: they are right however many processes there are."""

from dataclasses import dataclass

from sqlalchemy import Connection, and_, func, select

from app.storage.tables import audit_items, audits, loops, uploads, verdicts
from app.storage.types import now


@dataclass(frozen=True)
class Figures:
    """items: loops of unfinished runs by state. verdicts: loops by their newest verdict. failures: failed loops of the
    newest ended run by code. oldest_open_s: age of the oldest run that is not ended, in seconds (0: none).
    audit_seconds: mean time of an audit over the newest verdicts."""

    loops: int
    uploads: dict[str, int]
    items: dict[str, int]
    verdicts: dict[str, int]
    failures: dict[str, int]
    oldest_open_s: float
    audit_seconds: float | None


def collect(connection: Connection) -> Figures:
    unfinished = select(audits.c.id).where(audits.c.state.in_(("planned", "running")))
    newest = loops.join(
        verdicts, and_(verdicts.c.loop_id == loops.c.id, verdicts.c.audit_id == loops.c.newest_audit_id)
    )
    last_run = select(func.max(audits.c.id)).where(audits.c.ended_at.is_not(None)).scalar_subquery()
    oldest = connection.scalar(select(func.min(audits.c.created_at)).where(audits.c.id.in_(unfinished)))
    return Figures(
        loops=connection.scalar(select(func.count()).select_from(loops)) or 0,
        uploads=_counts(connection, select(uploads.c.state, func.count()).group_by(uploads.c.state)),
        items=_counts(
            connection,
            select(audit_items.c.state, func.count())
            .where(audit_items.c.audit_id.in_(unfinished))
            .group_by(audit_items.c.state),
        ),
        verdicts=_counts(
            connection, select(verdicts.c.verdict, func.count()).select_from(newest).group_by(verdicts.c.verdict)
        ),
        failures=_counts(
            connection,
            select(audit_items.c.code, func.count())
            .where(audit_items.c.audit_id == last_run, audit_items.c.state == "failed")
            .group_by(audit_items.c.code),
        ),
        oldest_open_s=0.0 if oldest is None else (now() - oldest).total_seconds(),
        audit_seconds=connection.scalar(select(func.avg(verdicts.c.elapsed_s)).select_from(newest)),
    )


def _counts(connection: Connection, query: object) -> dict[str, int]:
    return {name: count for name, count in connection.execute(query)}  # type: ignore[call-overload]
