"""Uploads, who reads them at the moment, and what became of them."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Connection, Text, case, cast, delete, func, insert, literal, or_, select, update

from app.counting import counted_times
from app.storage.bulk import among_many, insert_new, insert_new_rows
from app.storage.loops import IN_SERVICE
from app.storage.receipts import next_number
from app.storage.tables import UNREAD, audits, loops, rejects, upload_loops, uploads
from app.storage.types import clock_s, long_ago, longer_pause, now, run_out

OUR_FAULTS = ("reader_lost", "fault")
BACK_OFF = range(3, 10)
"""Attempts after which the pause to the next one doubles; after more of them it stays."""
NO_PAUSE: dict[str, None] = {"pause_s": None, "waits_since": None, "unseen_since": None}
GOING = "going:"
"""How the content key of an upload begins that is being dropped; that of any other is hexadecimal."""


@dataclass(frozen=True)
class UploadRow:
    """An upload without what may have megabytes: the mapping to read it by (see `reading_of`) and its tags (see
    `tags_of`)."""

    id: int
    fingerprint: str
    filename: str
    content_type: str | None
    size_bytes: int
    received_at: datetime
    received_by: str | None
    sent_again_at: datetime | None
    state: str
    ended_at: datetime | None
    error_code: str | None
    error_text: str | None
    attempts: int
    waits_since: datetime | None
    unseen_since: datetime | None
    summary_json: str | None

    @property
    def summary(self) -> dict[str, Any]:
        return json.loads(self.summary_json) if self.summary_json else {}


@dataclass(frozen=True)
class RejectRow:
    line: int | None
    code: str
    text: str
    tag: str


@dataclass(frozen=True)
class ReadingClaim:
    """The right to read an upload, until the lease ends; `attempt` fences off whoever had it before."""

    upload_id: int
    attempt: int
    owner: str
    receipt_number: int


COLUMNS = [uploads.c[name] for name in UploadRow.__dataclass_fields__]


def receive(connection: Connection, values: dict[str, Any]) -> tuple[UploadRow, bool]:
    """The upload of this content, and whether it is a new one; one that is not is noted to have come again."""
    inserting = insert_new(connection, uploads).values({**values, "received_at": now()}).returning(uploads.c.id)
    created = connection.scalar(inserting) is not None  # PostgreSQL does not count the rows of such an insert
    this = uploads.c.content_key == values["content_key"]
    noted = {"receipt_number": next_number(connection)} if created else {"sent_again_at": now()}
    connection.execute(update(uploads).where(this).values(noted))
    return UploadRow(*connection.execute(select(*COLUMNS).where(this)).one()), created


def keys_of(connection: Connection, fingerprint: str, reading_json: str) -> list[str]:
    """The content keys of uploads of these bytes that are read so, the oldest first; of none that is being dropped."""
    same = (uploads.c.fingerprint == fingerprint, uploads.c.reading_json == reading_json, ~going())
    return list(connection.scalars(select(uploads.c.content_key).where(*same).order_by(uploads.c.id)))


def going() -> ColumnElement[bool]:
    """Whether an upload is being dropped: piece by piece, so that its receipt is no longer whole."""
    return uploads.c.content_key.startswith(GOING)


def let_go(connection: Connection, upload_ids: Iterable[int], such: ColumnElement[bool]) -> list[int]:
    """Those of the uploads of which `such` holds lose their content key: what is sent again is a new upload from now
    on, with an address that stays."""
    key = literal(GOING) + cast(uploads.c.id, Text)
    losing = update(uploads).where(uploads.c.id.in_(list(upload_ids)), such).values(content_key=key)
    return list(connection.scalars(losing.returning(uploads.c.id)))


def by_id(connection: Connection, upload_id: int) -> UploadRow | None:
    row = connection.execute(select(*COLUMNS).where(uploads.c.id == upload_id)).one_or_none()
    return None if row is None else UploadRow(*row)


def any_known(connection: Connection) -> bool:
    return connection.scalar(select(uploads.c.id).limit(1)) is not None


def reading_of(connection: Connection, upload_id: int) -> dict[str, Any]:
    """How the upload is to be read, with its mapping, which may have megabytes."""
    return json.loads(connection.execute(select(uploads.c.reading_json).where(uploads.c.id == upload_id)).scalar_one())


def tags_of(connection: Connection, upload_id: int) -> list[dict[str, Any]]:
    """Which tag of the file became which signal of which loop; a plant has tens of thousands."""
    told = connection.scalar(select(uploads.c.tags_json).where(uploads.c.id == upload_id))
    return json.loads(told) if told else []


def page(connection: Connection, limit: int, before_id: int | None) -> list[UploadRow]:
    """Uploads, the newest first."""
    query = select(*COLUMNS).order_by(uploads.c.id.desc()).limit(limit)
    if before_id is not None:
        query = query.where(uploads.c.id < before_id)
    return [UploadRow(*row) for row in connection.execute(query)]


def rejects_of(connection: Connection, upload_id: int) -> list[RejectRow]:
    query = select(rejects.c.line, rejects.c.code, rejects.c.text, rejects.c.tag)
    found = connection.execute(query.where(rejects.c.upload_id == upload_id).order_by(rejects.c.number))
    return [RejectRow(*row) for row in found]


def loops_of(connection: Connection, upload_id: int) -> list[str]:
    query = select(loops.c.tag).join(upload_loops, upload_loops.c.loop_id == loops.c.id)
    return list(connection.scalars(query.where(upload_loops.c.upload_id == upload_id).order_by(loops.c.tag)))


def retired_of(connection: Connection, upload_id: int) -> list[str]:
    """Those of the upload's loops that are retired."""
    query = select(loops.c.tag).join(upload_loops, upload_loops.c.loop_id == loops.c.id)
    mine = (upload_loops.c.upload_id == upload_id, loops.c.retired)
    return list(connection.scalars(query.where(*mine).order_by(loops.c.tag)))


def audited_since(connection: Connection, upload_id: int) -> dict[int, int]:
    """By run, of those that were begun after the upload was read: how many of its loops in service have their newest
    verdict of it; the newest run first."""
    query = select(audits.c.id, func.count()).select_from(upload_loops)
    query = query.join(uploads, uploads.c.id == upload_loops.c.upload_id)
    query = query.join(loops, loops.c.id == upload_loops.c.loop_id).join(audits, audits.c.id == loops.c.newest_audit_id)
    mine = (uploads.c.id == upload_id, audits.c.created_at >= uploads.c.ended_at, IN_SERVICE)
    found = connection.execute(query.where(*mine).group_by(audits.c.id).order_by(audits.c.id.desc()))
    return {run: count for run, count in found}


def count_loops(connection: Connection, upload_ids: Sequence[int]) -> dict[int, int]:
    """How many loops were found in each of the uploads; those without any are left out."""
    found = upload_loops.c.upload_id
    query = select(found, func.count()).where(found.in_(list(upload_ids))).group_by(found)
    return {upload_id: count for upload_id, count in connection.execute(query)}


def unread_fingerprints(connection: Connection) -> set[str]:
    return set(connection.scalars(select(uploads.c.fingerprint).where(UNREAD)))


def waiting_for_room(connection: Connection) -> tuple[int, UploadRow | None]:
    """How many uploads wait for room on the disk, and the one that has waited longest."""
    waits = (UNREAD, uploads.c.state == "received", uploads.c.waits_since.is_not(None))
    count = connection.scalar(select(func.count()).select_from(uploads).where(*waits)) or 0
    longest = select(*COLUMNS).where(*waits).order_by(uploads.c.waits_since, uploads.c.id).limit(1)
    row = connection.execute(longest).one_or_none() if count else None
    return count, None if row is None else UploadRow(*row)


def lock_bytes(connection: Connection, fingerprint: str) -> None:
    """Whoever registers or drops these bytes waits for whoever does so now, until the transaction ends. On SQLite every
    transaction that writes waits already."""
    if connection.dialect.name == "postgresql":
        connection.execute(select(func.pg_advisory_xact_lock(func.hashtextextended(fingerprint, 0))))


def claim(connection: Connection, upload_id: int, owner: str, lease_s: float, max_attempts: int) -> ReadingClaim | None:
    """The right to read, or None where somebody else has it or the upload has ended."""
    claimed = connection.execute(
        update(uploads)
        .where(uploads.c.id == upload_id, UNREAD, _free(lease_s), uploads.c.attempts < max_attempts)
        .values(state="reading", owner=owner, lease_until_s=clock_s() + lease_s, attempts=uploads.c.attempts + 1)
        .values(unseen_since=None, pause_s=case((uploads.c.unseen_since.is_(None), uploads.c.pause_s)))
        .returning(uploads.c.attempts, uploads.c.receipt_number)
    ).one_or_none()
    return None if claimed is None else ReadingClaim(upload_id, claimed.attempts, owner, claimed.receipt_number)


def renew(connection: Connection, claim: ReadingClaim, lease_s: float) -> bool:
    """Whether the claim still holds; its lease then starts anew."""
    result = connection.execute(_held(claim).values(lease_until_s=clock_s() + lease_s))
    return result.rowcount == 1


STORED_SO_FAR = "stored_so_far"


def note_stored(connection: Connection, claim: ReadingClaim, samples: int, replaced: int) -> None:
    """Counts what a part of the upload brought, in the transaction that stores it: whoever reads the rest after a
    worker that was lost, or after a commit whose answer was, finds that part stored already."""
    so_far = stored_so_far(connection, claim)
    told = {STORED_SO_FAR: [so_far[0] + samples, so_far[1] + replaced]}
    connection.execute(_held(claim).values(summary_json=json.dumps(told)))


def stored_so_far(connection: Connection, claim: ReadingClaim) -> tuple[int, int]:
    """Samples that were not there before, and samples that took the place of other values, by all tries to read it,
    those before it failed by a fault of ours and was sent again too. What was read to its end has none any more."""
    summary = connection.scalar(select(uploads.c.summary_json).where(uploads.c.id == claim.upload_id))
    samples, replaced = json.loads(summary or "{}").get(STORED_SO_FAR, (0, 0))
    return samples, replaced


def end(connection: Connection, claim: ReadingClaim, state: str, values: dict[str, Any]) -> bool:
    result = connection.execute(
        _held(claim).values(state=state, ended_at=now(), owner=None, lease_until_s=None, **NO_PAUSE, **values)
    )
    return result.rowcount == 1


def note_loops(connection: Connection, upload_id: int, loop_ids: Iterable[int]) -> None:
    rows = [{"upload_id": upload_id, "loop_id": loop_id} for loop_id in sorted(loop_ids)]
    if rows:
        insert_new_rows(connection, upload_loops, rows)


def replace_rejects(connection: Connection, upload_id: int, listed: Sequence[RejectRow]) -> None:
    connection.execute(delete(rejects).where(rejects.c.upload_id == upload_id))
    rows = [{"upload_id": upload_id, "number": number, **vars(reject)} for number, reject in enumerate(listed)]
    if rows:
        connection.execute(insert(rejects), rows)


def give_up(connection: Connection, max_attempts: int, lease_s: float) -> int:
    """Uploads whose readers died too often become failed; also those that wait to be read, which nobody could claim:
    more tries were allowed when the last one began."""
    result = connection.execute(
        update(uploads)
        .where(UNREAD, _free(lease_s), uploads.c.attempts >= max_attempts)
        .values(
            state="failed",
            ended_at=now(),
            error_code="reader_lost",
            error_text=f"the worker that read this file was lost, {counted_times(max_attempts)}",
            owner=None,
            lease_until_s=None,
            **NO_PAUSE,
        )
    )
    return result.rowcount


def to_announce(connection: Connection, stalled_s: float, lease_s: float) -> list[int]:
    """Uploads that nobody reads, and that nobody was told of lately; they count as told from now on.

    One that was tried in vain waits longer from the third time on, one that found no room, or whose file no worker
    sees, as long as its pause.
    """
    since = uploads.c.announced_s
    unseen = uploads.c.unseen_since.is_not(None)
    waits = ((uploads.c.state == "received") | unseen) & uploads.c.pause_s.is_not(None)
    no_room = (waits, long_ago(since, uploads.c.pause_s))
    longer = [
        (uploads.c.attempts >= tries, long_ago(since, stalled_s * 2 ** (tries - 2))) for tries in reversed(BACK_OFF)
    ]
    quiet = case(no_room, *longer, else_=long_ago(since, stalled_s))
    pause_s = case((unseen, longer_pause(uploads.c.pause_s, stalled_s)), else_=uploads.c.pause_s)
    told = {"announced_s": clock_s(), "pause_s": pause_s}
    found = connection.scalars(
        update(uploads).where(UNREAD, _free(lease_s), quiet).values(told).returning(uploads.c.id)
    )
    return sorted(found)


def _free(lease_s: float) -> ColumnElement[bool]:
    """Of an upload that is still to be read: whether nobody reads it."""
    return or_(uploads.c.state == "received", run_out(uploads.c.lease_until_s, lease_s))


def note_unseen(connection: Connection, upload_id: int, first_pause_s: float, lease_s: float) -> bool:
    """A worker that was rung for it does not see its file; whether it is one that nobody reads. The pause grows with
    each time that it is announced, not with each doorbell of those that heaped up."""
    since = func.coalesce(uploads.c.unseen_since, literal(now(), uploads.c.unseen_since.type))
    told = {"unseen_since": since, "pause_s": func.coalesce(uploads.c.pause_s, first_pause_s), "announced_s": clock_s()}
    unread = (uploads.c.id == upload_id, UNREAD, _free(lease_s))
    return connection.execute(update(uploads).where(*unread).values(told)).rowcount == 1


def unseen(connection: Connection, longer_than_s: float = 0.0) -> dict[int, str]:
    """The fingerprints of uploads whose files workers did not see, by upload; longer_than_s: those whose pause is."""
    paused = (uploads.c.unseen_since.is_not(None), uploads.c.pause_s > longer_than_s)
    found = select(uploads.c.id, uploads.c.fingerprint).where(UNREAD, *paused)
    return {upload_id: fingerprint for upload_id, fingerprint in connection.execute(found)}


def seen_again(connection: Connection, upload_ids: Iterable[int]) -> bool:
    """Whether the file of any of them was not seen, and now is: the next sweep announces them."""
    these = (among_many(connection, uploads.c.id, upload_ids), UNREAD, uploads.c.unseen_since.is_not(None))
    return connection.execute(update(uploads).where(*these).values(announced_s=None, **NO_PAUSE)).rowcount > 0


def _held(claim: ReadingClaim) -> Any:
    return update(uploads).where(
        uploads.c.id == claim.upload_id,
        uploads.c.state == "reading",
        uploads.c.owner == claim.owner,
        uploads.c.attempts == claim.attempt,
    )


def try_again(connection: Connection, upload_id: int) -> bool:
    """Whether an upload that failed by a fault of ours was sent again, and is to be read again."""
    return _anew(connection, upload_id, uploads.c.state == "failed", uploads.c.error_code.in_(OUR_FAULTS))


def read_anew(connection: Connection, upload_id: int) -> bool:
    """Whether an upload that was read to its end is to be read again: what it brought is not there any more."""
    return _anew(connection, upload_id, uploads.c.state == "done", ~going())


def _anew(connection: Connection, upload_id: int, *such: ColumnElement[bool]) -> bool:
    """It counts as received now: others were read meanwhile, and took no heed of it."""
    this = update(uploads).where(uploads.c.id == upload_id)
    anew = {"attempts": 0, "ended_at": None, "error_code": None, "error_text": None, **NO_PAUSE}
    again = connection.execute(this.where(*such).values(state="received", **anew)).rowcount == 1
    if again:
        connection.execute(this.values(receipt_number=next_number(connection)))
    return again


def hand_back(connection: Connection, claim: ReadingClaim) -> None:
    """The reading went wrong by a fault of ours: the lease ends now, so that the sweeper lets it be tried again."""
    connection.execute(_held(claim).values(lease_until_s=clock_s(), **NO_PAUSE))


def wait(connection: Connection, claim: ReadingClaim, first_pause_s: float, *, for_room: bool) -> None:
    """The disk was full, or the data folder away, which is no fault of the file: this attempt does not count, however
    long that lasts, and the pause to the next one doubles up to some minutes. for_room: told is since when it waits."""
    pause_s = longer_pause(uploads.c.pause_s, first_pause_s)
    waiting = {"state": "received", "attempts": uploads.c.attempts - 1, "owner": None, "lease_until_s": None}
    since = func.coalesce(uploads.c.waits_since, literal(now(), uploads.c.waits_since.type)) if for_room else None
    connection.execute(_held(claim).values(**waiting, pause_s=pause_s, waits_since=since, announced_s=clock_s()))
