"""Whether workers get on, told by what they leave in the data base: to all else one that hears nothing looks alive."""

from sqlalchemy import Column, ColumnElement, Connection, Table, bindparam, exists, func, or_, select

from app.storage.tables import UNFINISHED, audit_items, audits, deliveries, explanations, uploads
from app.storage.types import clock_s

CLAIMED = (
    (audit_items, "claimed", ("claimed",)),
    (uploads, "reading", ("received", "reading")),
    (explanations, "claimed", ("open", "claimed")),
    (deliveries, "claimed", ("open", "claimed")),
)
"""What workers hold while they work on it: its state then, and the states of the index by which it is found."""


def standstill_s(connection: Connection) -> float:
    """For how long no worker gave a sign although loops wait, in seconds; 0 where none waits, or a worker holds
    anything: a loop, an upload, an explanation or a digest.

    Signs are that workers were told of a run, which a worker does: at the end of what it audits in one go, and by a
    sweep, again and again, while nobody works on the run. Of several runs the one counts that they were told of longest
    ago. Work that nobody claims, such as dropping what is old, gives none.
    """
    waits = exists().where(audit_items.c.audit_id == audits.c.id, audit_items.c.state == "open")
    signs = (func.abs(audits.c.announced_s), audits.c.created_at, clock_s())
    unfinished = select(*signs).where(_in(audits.c.state, UNFINISHED))
    runs = connection.execute(unfinished.where(waits)).all()
    if not runs or connection.scalar(select(or_(*(_held(*work) for work in CLAIMED)))):
        return 0.0
    told = ((created_at.timestamp() if told_s is None else told_s, now_s) for told_s, created_at, now_s in runs)
    return max(0.0, *(now_s - told_s for told_s, now_s in told))


def _held(work: Table, claimed: str, indexed: tuple[str, ...]) -> ColumnElement[bool]:
    """Whether a claim still holds: one of a worker that is gone stays until its lease ends, or until a sweep comes."""
    state: Column[str] = work.c.state
    return exists().where(_in(state, indexed), state == claimed, work.c.lease_until_s >= clock_s())


def _in(state: Column[str], states: tuple[str, ...]) -> ColumnElement[bool]:
    """In the words of a partial index: to SQLite values that are sent beside a statement are not those."""
    return state.in_(bindparam(None, states, expanding=True, literal_execute=True, unique=True))
