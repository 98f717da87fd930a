"""Counts for those who run the service: few, small and indexed, because they are asked for every few seconds."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Connection, and_, func, select

from app.storage.tables import audit_items, audits, loops, uploads, verdicts

OPEN_RUNS = ("planned", "running")
UNREAD = ("received", "reading")


@dataclass(frozen=True)
class Figures:
    """uploads, open_items: how many by state. failures: failed loops by code, over the runs that are kept.

    verdicts: loops by newest verdict and reliability. elapsed_s: engine time of these verdicts.
    oldest_open_run, oldest_unread_upload: since when they wait, None where nothing does.
    """

    loops: int
    uploads: dict[str, int]
    open_items: dict[str, int]
    failures: dict[str, int]
    verdicts: dict[tuple[str, str], int]
    elapsed_s: float
    oldest_open_run: datetime | None
    oldest_unread_upload: datetime | None


def figures(connection: Connection) -> Figures:
    newest = verdicts.join(
        loops, and_(verdicts.c.loop_id == loops.c.id, verdicts.c.audit_id == loops.c.newest_audit_id)
    )
    verdict_counts = (
        select(verdicts.c.verdict, verdicts.c.reliability, func.count(), func.sum(verdicts.c.elapsed_s))
        .select_from(newest)
        .group_by(verdicts.c.verdict, verdicts.c.reliability)
    )
    rows = connection.execute(verdict_counts).all()
    return Figures(
        loops=connection.scalar(select(func.count()).select_from(loops)) or 0,
        uploads=_counts(connection, uploads.c.state, None),
        open_items=_counts(connection, audit_items.c.state, audit_items.c.state.in_(("open", "claimed"))),
        failures=_counts(connection, audit_items.c.code, audit_items.c.state == "failed"),
        verdicts={(verdict, reliability): count for verdict, reliability, count, _ in rows},
        elapsed_s=sum(elapsed or 0.0 for *_, elapsed in rows),
        oldest_open_run=connection.scalar(select(func.min(audits.c.created_at)).where(audits.c.state.in_(OPEN_RUNS))),
        oldest_unread_upload=connection.scalar(
            select(func.min(uploads.c.received_at)).where(uploads.c.state.in_(UNREAD))
        ),
    )


def _counts(
    connection: Connection, column: ColumnElement[Any], condition: ColumnElement[bool] | None
) -> dict[str, int]:
    query = select(column, func.count()).group_by(column)
    if condition is not None:
        query = query.where(condition)
    return {str(key): count for key, count in connection.execute(query)}
