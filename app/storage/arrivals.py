"""How far records reach: of the plant as it is now, or of what one run was given."""

from typing import Any

from sqlalchemy import Connection, Subquery, and_, func, or_, select

from app.storage.loops import IN_SERVICE
from app.storage.tables import loops, verdicts


def newest(connection: Connection, since_ns: int, until_ns: int, audit_id: int | None = None) -> int | None:
    """Time of the newest sample of all loops, of those between the two, both included; None where there is none.

    audit_id: of what this run was given; None: of all that is stored.
    """
    ends = _ends(audit_id)
    return connection.scalar(select(func.max(ends.c.end_ns)).where(ends.c.end_ns.between(since_ns, until_ns)))


def ending(
    connection: Connection, since_ns: int, before_ns: int, limit: int, audit_id: int | None = None
) -> tuple[int, list[tuple[str, int]]]:
    """How many loops have their newest sample from `since_ns` on and before `before_ns`, and tag and time of the
    weightiest of them."""
    ends = _ends(audit_id)
    such = and_(ends.c.end_ns >= since_ns, ends.c.end_ns < before_ns)
    count = connection.scalar(select(func.count()).select_from(ends).where(such)) or 0
    if not count:
        return 0, []
    query = select(ends.c.tag, ends.c.end_ns).where(such).order_by(ends.c.importance.desc(), ends.c.tag).limit(limit)
    return count, [(tag, end_ns) for tag, end_ns in connection.execute(query)]


def anything_new(connection: Connection, audit_id: int) -> bool:
    """Whether a loop of this run was given samples that its verdict before was not, or has none before."""
    earlier = verdicts.alias("earlier")
    known = select(func.max(earlier.c.input_end_ns)).where(
        earlier.c.loop_id == verdicts.c.loop_id, earlier.c.audit_id < audit_id
    )
    before = known.correlate(verdicts).scalar_subquery()
    newer = or_(before.is_(None), verdicts.c.input_end_ns > before)
    query = select(verdicts.c.loop_id).where(verdicts.c.audit_id == audit_id, newer)
    return connection.scalar(query.limit(1)) is not None


def _ends(audit_id: int | None) -> Subquery:
    """Tag, importance and newest sample of each loop that is in service: nothing more is to come of the others."""
    shown: tuple[Any, ...] = (loops.c.tag, loops.c.importance)
    if audit_id is None:
        query = select(*shown, loops.c.newest_ns.label("end_ns"))
        return query.where(loops.c.newest_ns.is_not(None), IN_SERVICE).subquery()
    query = select(*shown, verdicts.c.input_end_ns.label("end_ns")).join(verdicts, verdicts.c.loop_id == loops.c.id)
    given = (verdicts.c.audit_id == audit_id, verdicts.c.input_end_ns.is_not(None))
    return query.where(*given, IN_SERVICE).subquery()
