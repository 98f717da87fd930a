"""Whether workers get on, told by what they leave in the database: to all else one that hears nothing looks alive."""

from sqlalchemy import ColumnElement, Connection, Table, exists, func, or_, select

from app.storage.tables import (
    GOING_ON,
    UNDELIVERED,
    UNEXPLAINED,
    UNREAD,
    audit_items,
    audits,
    deliveries,
    explanations,
    in_words,
    uploads,
)
from app.storage.types import clock_s

CLAIMED: tuple[tuple[Table, ColumnElement[bool]], ...] = (
    (audit_items, in_words(audit_items.c.state, "claimed")),
    (uploads, UNREAD & (uploads.c.state == "reading")),
    (explanations, UNEXPLAINED & (explanations.c.state == "claimed")),
    (deliveries, UNDELIVERED & (deliveries.c.state == "claimed")),
)
"""What workers hold while they work on it, in the words of the index by which it is found."""


def standstill_s(connection: Connection) -> float:
    """For how long no worker gave a sign although loops wait, in seconds; 0 where none waits, or a worker holds
    anything: a loop, an upload, an explanation or a digest.

    Signs are that workers were told of a run, which a worker does: at the end of what it audits in one go, and by a
    sweep, again and again, while nobody works on the run. Of several runs the one counts that they were told of longest
    ago. Work that nobody claims, such as dropping what is old, gives none.
    """
    waits = exists().where(audit_items.c.audit_id == audits.c.id, audit_items.c.state == "open")
    signs = (func.abs(audits.c.announced_s), audits.c.created_at, clock_s())
    at_work = or_(*(_held(*work) for work in CLAIMED))
    runs = connection.execute(select(*signs).where(GOING_ON, waits, ~at_work)).all()
    told = ((created_at.timestamp() if told_s is None else told_s, now_s) for told_s, created_at, now_s in runs)
    return max((0.0, *(now_s - told_s for told_s, now_s in told)))


def _held(work: Table, claimed: ColumnElement[bool]) -> ColumnElement[bool]:
    """Whether a claim still holds: one of a worker that is gone stays until its lease ends, or until a sweep comes."""
    return exists().where(claimed, work.c.lease_until_s >= clock_s())
