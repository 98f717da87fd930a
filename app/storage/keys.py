"""Keys and the sessions that were opened with them."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import ColumnElement, Connection, and_, delete, insert, or_, select, update

from app.storage.tables import keys, sessions
from app.storage.types import CLOCK_APART, now


@dataclass(frozen=True)
class KeyRow:
    id: int
    public_id: str
    secret_hash: str
    name: str
    role: str
    requests_per_minute: int
    created_at: datetime
    expires_at: datetime | None
    revoked_at: datetime | None
    last_used_at: datetime | None
    followed_by: str | None


COLUMNS = [keys.c[name] for name in KeyRow.__dataclass_fields__]


def add(connection: Connection, values: dict[str, Any]) -> KeyRow:
    public_id = values["public_id"]
    connection.execute(insert(keys).values(**values, created_at=now()))
    return KeyRow(*connection.execute(select(*COLUMNS).where(keys.c.public_id == public_id)).one())


def by_public_id(connection: Connection, public_id: str) -> KeyRow | None:
    row = connection.execute(select(*COLUMNS).where(keys.c.public_id == public_id)).one_or_none()
    return None if row is None else KeyRow(*row)


def every(connection: Connection) -> list[KeyRow]:
    return [KeyRow(*row) for row in connection.execute(select(*COLUMNS).order_by(keys.c.id))]


def end(connection: Connection, key_id: int, *, revoked_at: datetime) -> None:
    """Revokes the key; the sessions that were opened with it end."""
    connection.execute(
        update(keys).where(keys.c.id == key_id, keys.c.revoked_at.is_(None)).values(revoked_at=revoked_at)
    )
    connection.execute(delete(sessions).where(sessions.c.key_id == key_id))


def give_way(connection: Connection, key_id: int, at: datetime, follower: str) -> bool:
    """The key ends at `at`, or earlier where it was to end earlier, and another one (its public_id) follows it; False
    where one follows it already."""
    later = or_(keys.c.expires_at.is_(None), keys.c.expires_at > at)
    this = keys.c.id == key_id
    alone = update(keys).where(this, keys.c.followed_by.is_(None)).values(followed_by=follower)
    if connection.execute(alone).rowcount == 0:
        return False
    connection.execute(update(keys).where(this, later).values(expires_at=at))
    return True


def note_use(connection: Connection, key_id: int, every_s: float) -> None:
    """Writes when the key was used, unless that was written within the last `every_s` seconds. What a clock wrote that
    was ahead gives way."""
    moment = now()
    long_ago, ahead = moment - timedelta(seconds=every_s), moment + CLOCK_APART
    noted = keys.c.last_used_at
    stale = or_(noted.is_(None), noted < long_ago, noted > ahead)
    connection.execute(update(keys).where(keys.c.id == key_id, stale).values(last_used_at=moment))


def open_session(connection: Connection, token_hash: str, key_id: int, expires_at: datetime) -> None:
    connection.execute(delete(sessions).where(~_goes_on()))
    connection.execute(
        insert(sessions).values(token_hash=token_hash, key_id=key_id, created_at=now(), expires_at=expires_at)
    )


@dataclass(frozen=True)
class SessionRow:
    key: KeyRow
    created_at: datetime
    expires_at: datetime


def session(connection: Connection, token_hash: str) -> SessionRow | None:
    """A session with the key that it was opened with; None where it has ended or never was, or was opened by a clock
    that was ahead: it would go on until the clock comes there again."""
    query = (
        select(*COLUMNS, sessions.c.created_at, sessions.c.expires_at)
        .join(sessions, sessions.c.key_id == keys.c.id)
        .where(sessions.c.token_hash == token_hash, _goes_on())
    )
    row = connection.execute(query).one_or_none()
    return None if row is None else SessionRow(KeyRow(*row[:-2]), *row[-2:])


def extend_session(connection: Connection, token_hash: str, expires_at: datetime) -> None:
    """Never brings back a session that was closed or has ended."""
    this = update(sessions).where(sessions.c.token_hash == token_hash, _goes_on())
    connection.execute(this.values(expires_at=expires_at))


def close_session(connection: Connection, token_hash: str) -> None:
    connection.execute(delete(sessions).where(sessions.c.token_hash == token_hash))


def _goes_on() -> ColumnElement[bool]:
    moment = now()
    return and_(sessions.c.expires_at > moment, sessions.c.created_at <= moment + CLOCK_APART)
