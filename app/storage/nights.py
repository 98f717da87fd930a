"""What was said of loops night after night."""

from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

from sqlalchemy import Connection, and_, func, select

from app.storage.newest import last_of
from app.storage.tables import audits, loops, verdicts

other, same = verdicts.alias("otherwise"), verdicts.alias("sticking")


class NightRow(NamedTuple):
    """A verdict of a loop; input_end_ns: the last sample that it was made of; window_end: of what was judged;
    run_begun: when its run began; nightly_for: the date whose night that is, None: no night's."""

    tag: str
    audited_at: datetime
    verdict: str
    reliability: str
    input_end_ns: int | None
    window_end: datetime | None
    run_begun: datetime
    nightly_for: str | None


class StickingRow(NamedTuple):
    """The first verdict that said that a valve sticks. otherwise: the last run that said otherwise; None: there is
    none."""

    tag: str
    audited_at: datetime
    reasons: str
    extra_json: str
    otherwise: int | None


def recent(connection: Connection, tags: Sequence[str], each: int, until: int | None = None) -> list[NightRow]:
    """The newest verdicts of these loops, `each` at most, the oldest first. until: the last run that counts."""
    lasts, theirs = last_of(
        each, loops.c.tag.in_(tags), lambda said, _: () if until is None else (said.c.audit_id <= until,)
    )
    told = (*(verdicts.c[name] for name in NightRow._fields[1:-2]), audits.c.created_at, audits.c.nightly_for)
    query = (
        select(lasts.c.tag, *told).join_from(lasts, verdicts, theirs).join(audits, audits.c.id == verdicts.c.audit_id)
    )
    ordered = query.order_by(lasts.c.tag, verdicts.c.audit_id)
    return [NightRow._make(row) for row in connection.execute(ordered)]


def first_sticking(connection: Connection, tags: Sequence[str], until: int | None = None) -> list[StickingRow]:
    """Of loops that stick, the first verdict that said so and was followed by no other. until: as above."""
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
    return [StickingRow._make(row) for row in connection.execute(query)]
