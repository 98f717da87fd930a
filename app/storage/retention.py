"""What is old: dropped in small batches, each its own short statement, so that nobody waits behind them."""

from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import ColumnElement, Connection, Table, and_, delete, exists, func, or_, select, true, tuple_, update

from app.nanoseconds import NS_PER_S
from app.storage.ahead import newest_of_all_until
from app.storage.audits import ENDED
from app.storage.locks import Lock, hold
from app.storage.steps import HOLDING
from app.storage.tables import (
    AS_RECEIVED,
    UNREAD,
    audits,
    explanations,
    loops,
    rejects,
    series,
    sessions,
    trail,
    upload_loops,
    uploads,
    verdict_details,
    verdicts,
)
from app.storage.tallies import UPLOAD_BYTES, tally
from app.storage.types import CLOCK_APART, now
from app.storage.uploads import going, let_go, lock_bytes

UPLOADS_AT_ONCE = 10  # the row of each may have megabytes of tags and mapping


def one_at_a_time(connection: Connection) -> None:
    """Until the transaction ends nobody else drops what is old: who waits for rows that somebody else is dropping finds
    none, and would take that for the end."""
    hold(connection, Lock.RETENTION)


def drop_series(connection: Connection, kept_h: float, batch: int, until_ns: int, dated_ns: int = 0) -> int:
    """Stretches that ended so long before the newest sample of their loop, of those up to `until_ns`: an archive sent
    late stays whole, and so does what a sample ahead of the clock would make old. What ended before `dated_ns`
    (0: nothing) has no date, and is old when it came so long ago.

    Those stay that say which set point and mode held then: they hold until their next value, however old they are.
    """
    since = newest_of_all_until(connection, until_ns) - int(kept_h * 3600) * NS_PER_S
    old = (
        select(series.c.id)
        # + 0: else both databases walk all stretches there are and look up the loop of each; so they walk the loops.
        .join(loops, loops.c.id + 0 == series.c.loop_id)
        .where(or_(series.c.end_ns >= dated_ns, ~_came_since(now() - timedelta(hours=kept_h))))
        .where(series.c.end_ns < since, *(_held_no_more(f"{begin}_ns", since) for begin in HOLDING.values()))
        .limit(batch)
    )
    return connection.execute(delete(series).where(series.c.id.in_(old))).rowcount


def _came_since(moment: datetime) -> ColumnElement[bool]:
    brought_it = exists().where(uploads.c.id == series.c.upload_id, _last_sent() >= moment)
    return brought_it.correlate(series, loops)


def _last_sent() -> ColumnElement[datetime]:
    return func.coalesce(uploads.c.sent_again_at, uploads.c.received_at)


def _held_no_more(name: str, since: ColumnElement[int]) -> ColumnElement[bool]:
    """Whether what a stretch last knew of a signal was replaced before `since`, or it knew nothing of it."""
    later, at = series.alias(), series.c[name]
    over = tuple_(*(later.c[column.name] for column in AS_RECEIVED)) > tuple_(*AS_RECEIVED)
    replaced = or_(later.c[name] > at, and_(later.c[name] == at, over))
    mine = exists().where(later.c.loop_id == series.c.loop_id, later.c[name] < since, later.c[name] >= at, replaced)
    return or_(at.is_(None), mine.correlate(series, loops))


def drop_details(connection: Connection, before: datetime, batch: int) -> int:
    """Details of verdicts of runs that ended before; those of a loop's newest verdict stay."""
    return _drop_of_runs(connection, verdict_details, before, batch)


def drop_verdicts(connection: Connection, before: datetime, batch: int) -> int:
    """Verdicts of runs that ended before, then the runs that have none left; a loop's newest verdict stays."""
    dropped = _drop_of_runs(connection, verdict_details, before, batch) or _drop_of_runs(
        connection, verdicts, before, batch
    )
    if dropped:
        return dropped
    empty = (
        select(audits.c.id)
        .where(_ended_before(before), ~exists().where(verdicts.c.audit_id == audits.c.id))
        .order_by(audits.c.id)
        .limit(1)  # with it go its items, one a loop of the plant
    )
    return connection.execute(delete(audits).where(audits.c.id.in_(empty))).rowcount


def drop_explanations(connection: Connection, before: datetime, batch: int) -> int:
    old = (
        select(explanations.c.id)
        .where(explanations.c.state.in_(("done", "failed")), explanations.c.ended_at < before)
        .limit(batch)
    )
    return connection.execute(delete(explanations).where(explanations.c.id.in_(old))).rowcount


def drop_uploads(connection: Connection, before: datetime, batch: int, *, exports_since: datetime | None) -> int:
    """Uploads that ended before and whose bytes are not kept: first what hangs on their rows, as many as a plant has
    loops, then the rows. What was read from them stays."""
    found = _no_longer_sent_to(connection, _ended_uploads(before, exports_since))
    if not found:
        return 0
    return (
        _drop_of_uploads(connection, rejects, found, batch)
        or _drop_of_uploads(connection, upload_loops, found, batch)
        or _take_out_of_series(connection, found, batch)
        or _drop_their_rows(connection, found)
    )


def _ended_uploads(before: datetime, exports_since: datetime | None) -> ColumnElement[bool]:
    """Neither ended nor sent again since."""
    ended = uploads.c.state.in_(("done", "failed")) & (uploads.c.ended_at < before)
    return ended & (func.coalesce(uploads.c.sent_again_at, uploads.c.ended_at) < before) & ~_bytes_needed(exports_since)


def _no_longer_sent_to(connection: Connection, old: ColumnElement[bool]) -> list[int]:
    """Some uploads that are old, which whoever sends the same bytes again is not sent to any more.

    Under the lock of who does so now, and looked at anew: one that came again since is not old, and one that failed may
    be to be read again.
    """
    query = select(uploads.c.id, uploads.c.fingerprint, going()).where(old).order_by(uploads.c.id)
    found = connection.execute(query.limit(UPLOADS_AT_ONCE)).all()
    for fingerprint in sorted({row.fingerprint for row in found if not row[2]}):
        lock_bytes(connection, fingerprint)
    asked = [row.id for row in found if not row[2]]
    return [row.id for row in found if row[2]] + let_go(connection, asked, old)


def _drop_of_uploads(connection: Connection, table: Table, ids: Iterable[int], batch: int) -> int:
    key = table.primary_key.columns
    old = select(*key).where(table.c.upload_id.in_(ids)).limit(batch)
    return connection.execute(delete(table).where(tuple_(*key).in_(old))).rowcount


def _take_out_of_series(connection: Connection, ids: Iterable[int], batch: int) -> int:
    """The database would do so by itself, with all the stretches of a plant in one statement."""
    old = select(series.c.id).where(series.c.upload_id.in_(ids)).limit(batch)
    return connection.execute(update(series).where(series.c.id.in_(old)).values(upload_id=None)).rowcount


def _drop_their_rows(connection: Connection, found: Iterable[int]) -> int:
    gone = delete(uploads).where(uploads.c.id.in_(found)).returning(uploads.c.size_bytes)
    sizes = connection.scalars(gone).all()
    tally(connection, UPLOAD_BYTES, sum(sizes))
    return len(sizes)


def drop_trail(connection: Connection, before: datetime, batch: int) -> int:
    old = select(trail.c.id).where(trail.c.at < before).order_by(trail.c.at).limit(batch)
    return connection.execute(delete(trail).where(trail.c.id.in_(old))).rowcount


def drop_sessions(connection: Connection, batch: int) -> int:
    old = select(sessions.c.token_hash).where(sessions.c.expires_at < now()).limit(batch)
    return connection.execute(delete(sessions).where(sessions.c.token_hash.in_(old))).rowcount


def fingerprints_to_keep(connection: Connection, before: datetime | None) -> set[str]:
    """Of uploads whose bytes are still needed: not read yet, or last sent since; None: of all."""
    return set(connection.scalars(select(uploads.c.fingerprint).where(_bytes_needed(before))))


def must_keep(connection: Connection, fingerprint: str, before: datetime | None) -> bool:
    """Whether these are bytes that are still needed."""
    query = select(uploads.c.id).where(uploads.c.fingerprint == fingerprint, _bytes_needed(before)).limit(1)
    return connection.scalar(query) is not None


def last_done(connection: Connection, action: str) -> datetime | None:
    """When the schedule last did this to the end; not what a clock that was ahead says of it."""
    told = (trail.c.action == action, trail.c.outcome == "done", trail.c.at <= now() + CLOCK_APART)
    return connection.scalar(select(func.max(trail.c.at)).where(*told))


def _drop_of_runs(connection: Connection, table: Any, before: datetime, batch: int) -> int:
    runs = select(audits.c.id).where(_ended_before(before))
    old = (
        select(table.c.loop_id, table.c.audit_id)
        .join(loops, loops.c.id == table.c.loop_id)
        .where(table.c.audit_id.in_(runs), loops.c.newest_audit_id.is_distinct_from(table.c.audit_id))
        .limit(batch)
    )
    result = connection.execute(delete(table).where(tuple_(table.c.loop_id, table.c.audit_id).in_(old)))
    return result.rowcount


def _ended_before(before: datetime) -> ColumnElement[bool]:
    return audits.c.state.in_(ENDED) & (audits.c.ended_at < before)


def _bytes_needed(before: datetime | None) -> ColumnElement[bool]:
    if before is None:
        return true()
    return UNREAD | (_last_sent() >= before)
