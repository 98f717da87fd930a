"""Loops that go on under another tag: which one continues which, and notes that went along."""

from collections.abc import Collection, Sequence
from datetime import datetime

from sqlalchemy import CTE, ColumnElement, Connection, func, literal, or_, select, update

from app.storage.bulk import among_many
from app.storage.loops import IN_SERVICE
from app.storage.tables import loops, notes, series, verdicts

LONGEST_CHAIN = 20
"""So many tags of one loop are followed: what is asked of a longer chain, or of a ring, grows no further."""

FIRST = literal(1).label("names")

under_the_tag_after, its = loops.alias("under_the_tag_after"), verdicts.alias("said_under_the_tag_after")
that_continues, unjudged = loops.alias("that_continues"), loops.alias("never_judged")


def earlier_of(connection: Connection, tags: Collection[str]) -> dict[str, list[str]]:
    """By tag of the loops that continue another one, the tags of those before it, the newest first."""
    continued = select(loops.c.tag, loops.c.continues).where(loops.c.continues.is_not(None))
    found: dict[str, list[str]] = {}
    ends = {tag: tag for tag in tags}
    while ends:  # few: tags that were renamed
        before = dict(
            connection.execute(continued.where(among_many(connection, loops.c.tag, set(ends.values())))).all()
        )
        ends = {tag: before[end] for tag, end in ends.items() if end in before}
        for tag, end in ends.items():
            found.setdefault(tag, []).append(end)
        ends = {tag: end for tag, end in ends.items() if len(found[tag]) < LONGEST_CHAIN}
    return found


def later_of(connection: Connection, tag: str) -> str | None:
    """The tag of the loop that continues this one."""
    return connection.scalar(select(loops.c.tag).where(loops.c.continues == tag).order_by(loops.c.id).limit(1))


def counts_in(audit_id: int) -> ColumnElement[bool]:
    """Whether a loop counts in what a run said of the plant: one in service, or one that goes on, in service, under a
    tag, maybe after others, of none of which the run said anything."""
    later = under_the_tag_after
    said = select(its.c.loop_id).where(its.c.loop_id == later.c.id, its.c.audit_id == audit_id).correlate(later)
    unsaid = (later.c.continues.is_not(None), ~said.exists())
    gone_on = select(later.c.continues, later.c.tag.label("as_tag"), later.c.retired, FIRST).where(*unsaid)
    tags = gone_on.cte("tags_after", recursive=True)
    further = select(tags.c.continues, later.c.tag, later.c.retired, tags.c.names + 1)
    further = further.join(later, later.c.continues == tags.c.as_tag)
    tags = tags.union(further.where(*unsaid, tags.c.names < LONGEST_CHAIN))
    return or_(IN_SERVICE, loops.c.tag.in_(select(tags.c.continues).where(~tags.c.retired)))


def before_first_verdict() -> CTE:
    """By `tag` of each loop that continues another one, the tags before it (`earlier`) up to the first that was ever
    judged: under one that was not nothing was said."""
    later = that_continues
    one_before = select(later.c.tag, later.c.continues.label("earlier"), FIRST).where(later.c.continues.is_not(None))
    tags = one_before.cte("tags_before", recursive=True)
    further = select(tags.c.tag, unjudged.c.continues, tags.c.names + 1)
    further = further.join(unjudged, unjudged.c.tag == tags.c.earlier).where(tags.c.names < LONGEST_CHAIN)
    return tags.union(further.where(unjudged.c.newest_audit_id.is_(None), unjudged.c.continues.is_not(None)))


def move_notes(connection: Connection, from_id: int, to_id: int, of: Sequence[str]) -> None:
    """What was written of one loop goes to the other; `of`: only what was written under these tags, else all. Under
    which tag it was written stays, and is forgotten where it comes home."""
    home = select(loops.c.tag).where(loops.c.id == to_id).scalar_subquery()
    left = select(loops.c.tag).where(loops.c.id == from_id).scalar_subquery()
    mine = notes.c.loop_id == from_id
    wanted = or_(*(notes.c.written_of == tag for tag in of)) if of else notes.c.id.is_not(None)
    tag = func.coalesce(notes.c.written_of, left)
    connection.execute(update(notes).where(mine, wanted).values(loop_id=to_id, written_of=func.nullif(tag, home)))


def began(connection: Connection, loop_id: int) -> int | None:
    """Time of the loop's first sample that is kept."""
    return connection.scalar(select(func.min(series.c.start_ns)).where(series.c.loop_id == loop_id))


def stopped_between(connection: Connection, start_ns: int, end_ns: int, unit: str | None) -> list[str]:
    """The tags of loops in service whose newest sample is between the two, both included, that no loop continues; of
    the unit, where one is given."""
    later = loops.alias("later")
    gone_on = select(later.c.id).where(later.c.continues == loops.c.tag).exists()
    such = (IN_SERVICE, loops.c.newest_ns.between(start_ns, end_ns), ~gone_on)
    query = select(loops.c.tag).where(*such).order_by(loops.c.tag)
    return list(connection.scalars(query if unit is None else query.where(loops.c.unit == unit)))


def created_at(connection: Connection, loop_id: int) -> datetime:
    return connection.execute(select(loops.c.created_at).where(loops.c.id == loop_id)).scalar_one()
