"""What was said of loops night after night."""

from collections.abc import Sequence
from typing import Any

from sqlalchemy import Connection, and_, func, select

from app.storage.tables import loops, verdicts

TOLD = ("audited_at", "verdict", "reliability", "input_end_ns", "window_end")


def recent(connection: Connection, tags: Sequence[str], each: int, until: int | None = None) -> list[Any]:
    """The newest verdicts of these loops, `each` at most, the oldest first: tag, when audited, verdict, reliability,
    the last sample that it was made of, and the end of the window that was judged. until: the
    last run that counts.
    """
    # Places are found in the key alone: a year of whole rows would be read for the newest ones else.
    place = func.row_number().over(partition_by=verdicts.c.loop_id, order_by=verdicts.c.audit_id.desc())
    keys = select(loops.c.tag, verdicts.c.loop_id, verdicts.c.audit_id, place.label("place"))
    keys = keys.join(verdicts, verdicts.c.loop_id == loops.c.id).where(loops.c.tag.in_(tags))
    kept = (keys if until is None else keys.where(verdicts.c.audit_id <= until)).subquery()
    mine = and_(verdicts.c.loop_id == kept.c.loop_id, verdicts.c.audit_id == kept.c.audit_id)
    query = select(kept.c.tag, *(verdicts.c[name] for name in TOLD)).join(kept, mine)
    return list(connection.execute(query.where(kept.c.place <= each).order_by(kept.c.tag, kept.c.audit_id)))


def first_sticking(connection: Connection, tags: Sequence[str], until: int | None = None) -> list[Any]:
    """Of loops that stick, the first verdict that said so and was followed by no other: tag, when audited, its reasons,
    the fields of its row without a column, and the last run that said otherwise (None: there is none). until: as
    above."""
    other, same = verdicts.alias("otherwise"), verdicts.alias("sticking")
    last = () if until is None else (other.c.audit_id <= until,)
    otherwise = select(func.max(other.c.audit_id)).where(
        other.c.loop_id == loops.c.id, other.c.verdict != "stiction", *last
    )
    broken = otherwise.correlate(loops).scalar_subquery()
    sticks = (same.c.loop_id == loops.c.id, same.c.audit_id > func.coalesce(broken, 0))
    first = select(func.min(same.c.audit_id)).where(*sticks).correlate(loops).scalar_subquery()
    mine = and_(verdicts.c.loop_id == loops.c.id, verdicts.c.audit_id == first, verdicts.c.verdict == "stiction")
    told = (verdicts.c.audited_at, verdicts.c.reasons, verdicts.c.extra_json, broken.label("otherwise"))
    query = select(loops.c.tag, *told).select_from(loops.join(verdicts, mine)).where(loops.c.tag.in_(tags))
    return list(connection.execute(query))
