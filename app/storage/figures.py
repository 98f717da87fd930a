"""Numbers for monitoring, from SQL: they are right however many processes there are."""

from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import ColumnElement, Connection, func, select

from app.storage.audits import of_a_night
from app.storage.loops import IN_SERVICE, count, count_retired
from app.storage.newest import NEWEST_ROWS, NEWEST_VERDICTS
from app.storage.tables import GOING_ON, UNREAD, audit_items, audits, explanations, keys, newest_rows, uploads, verdicts
from app.storage.tallies import UPLOAD_BYTES, tallied
from app.storage.types import CLOCK_APART, now

DAY = timedelta(days=1)


@dataclass(frozen=True)
class EndedRun:
    """How long a run took, and when it ended, in seconds since 1970."""

    id: int
    took_s: float
    ended_s: float


@dataclass(frozen=True)
class Waiting:
    """items: loops of unfinished runs by state. oldest_open_s: age of the oldest run that is not ended, in seconds (0:
    none). oldest_unread_s: age of the oldest upload that is still to be read."""

    items: dict[str, int]
    oldest_open_s: float
    oldest_unread_s: float


@dataclass(frozen=True)
class Figures:
    """loops: those in service; retired: the others. waiting: what is still to be done. verdicts: loops by their newest
    verdict. failures: failed loops of the newest night that ended, by code; failures_day: of all runs that ended within
    24 h. audit_seconds: mean time of an audit over the newest verdicts. uploads_bytes: of all uploads as they came,
    those too that are not kept any more. last_run: the newest that ended, of any kind; last_night: the newest nightly
    one."""

    loops: int
    retired: int
    uploads: dict[str, int]
    waiting: Waiting
    verdicts: dict[str, int]
    failures: dict[str, int]
    failures_day: dict[str, int]
    audit_seconds: float | None
    uploads_bytes: int
    explanations: dict[str, int]
    last_run: EndedRun | None
    last_night: EndedRun | None
    active_keys: int


def waiting(connection: Connection) -> Waiting:
    """From what is unfinished alone, however much has been done: cheap enough for a probe every few seconds."""
    unfinished = select(audits.c.id).where(GOING_ON)
    by_state = select(audit_items.c.state, func.count()).where(audit_items.c.audit_id.in_(unfinished))
    unread = select(func.min(uploads.c.received_at)).where(UNREAD)
    oldest = select(func.min(audits.c.created_at)).where(audits.c.id.in_(unfinished))
    return Waiting(
        items=_counts(connection, by_state.group_by(audit_items.c.state)),
        oldest_open_s=_age_s(connection.scalar(oldest)),
        oldest_unread_s=_age_s(connection.scalar(unread)),
    )


def collect(connection: Connection) -> Figures:
    said = select(newest_rows.c.verdict, func.count()).select_from(NEWEST_ROWS).where(IN_SERVICE)
    took = select(func.avg(verdicts.c.elapsed_s)).select_from(NEWEST_VERDICTS).where(IN_SERVICE)
    night = _newest_ended(connection, of_a_night(the_first=True))
    today = audits.c.ended_at.between(now() - DAY, now() + CLOCK_APART)
    return Figures(
        loops=count(connection),
        retired=count_retired(connection),
        uploads=_counts(connection, select(uploads.c.state, func.count()).group_by(uploads.c.state)),
        waiting=waiting(connection),
        verdicts=_counts(connection, said.group_by(newest_rows.c.verdict)),
        failures=_failures(connection, audits.c.id == (night.id if night else None)),
        failures_day=_failures(connection, today),
        uploads_bytes=int(connection.scalar(select(func.sum(uploads.c.size_bytes))) or 0)
        + tallied(connection, UPLOAD_BYTES),
        explanations=_counts(connection, select(explanations.c.state, func.count()).group_by(explanations.c.state)),
        last_run=_newest_ended(connection),
        last_night=night,
        active_keys=_active_keys(connection),
        audit_seconds=connection.scalar(took),
    )


def _newest_ended(connection: Connection, *such: ColumnElement[bool]) -> EndedRun | None:
    """Not one that a clock ahead ended: it would be the newest until the clock comes there again, and hide that none
    ends any more."""
    ended = audits.c.ended_at <= now() + CLOCK_APART
    query = select(audits.c.id, audits.c.created_at, audits.c.ended_at).where(ended, *such)
    newest = query.order_by(audits.c.ended_at.desc(), audits.c.id.desc()).limit(1)
    found = connection.execute(newest).one_or_none()
    if found is None:
        return None
    run_id, created_at, ended_at = found
    took_s = max(0.0, (ended_at - created_at).total_seconds())  # a clock may be put back meanwhile
    return EndedRun(run_id, took_s, ended_at.timestamp())


def _failures(connection: Connection, of_runs: ColumnElement[bool]) -> dict[str, int]:
    failed = (audit_items.c.audit_id.in_(select(audits.c.id).where(of_runs)), audit_items.c.state == "failed")
    by_code = select(audit_items.c.code, func.count()).where(*failed).group_by(audit_items.c.code)
    return _counts(connection, by_code)


def _age_s(moment: datetime | None) -> float:
    return 0.0 if moment is None else max(0.0, (now() - moment).total_seconds())


def _active_keys(connection: Connection) -> int:
    good = keys.c.revoked_at.is_(None) & (keys.c.expires_at.is_(None) | (keys.c.expires_at > now()))
    return connection.scalar(select(func.count()).select_from(keys).where(good)) or 0


def _counts(connection: Connection, query: object) -> dict[str, int]:
    return {name: count for name, count in connection.execute(query)}  # type: ignore[call-overload]
